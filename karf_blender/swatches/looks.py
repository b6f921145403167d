"""Looks: named states of all swatches of a scene, kept in the .blend as the JSON of an edit; one of them is in use."""

import json
from contextlib import suppress
from string import ascii_uppercase

import bpy

from ..engine_api import BadRequest, DataError, Edit, edit_from_json, edit_to_json, file_name
from . import colors, edits


def captured(scene: bpy.types.Scene) -> str:
    """Return the current swatches as a look keeps them."""
    return json.dumps(edit_to_json(edits.current_edit(scene)))


def edit_of(look: bpy.types.PropertyGroup) -> Edit:
    """Return the edit that a look keeps. Raises DataError where its text is damaged."""
    scene = look.id_data
    try:
        content = json.loads(look.edit)
    except (ValueError, RecursionError) as error:
        raise DataError(
            "The look {name!r} is not a valid edit: {error}.",
            "Remove the look, and keep it again.",
            name=look.name,
            error=error,
        ) from error
    return edit_from_json(content, look.name, colors.palettes(scene), scene.karf.compositing)


def readable(scene: bpy.types.Scene) -> dict[str, Edit]:
    """Return the edits of a scene's looks by name, without damaged ones."""
    found = {}
    for look in scene.karf.looks:
        with suppress(DataError):
            found[look.name] = edit_of(look)
    return found


def named(scene: bpy.types.Scene, name: str) -> bpy.types.PropertyGroup:
    """Return the scene's look with this name. Raises BadRequest where there is none."""
    look = scene.karf.looks.get(name)
    if look is None:
        known = ", ".join(scene.karf.looks.keys())
        raise BadRequest(
            "The scene has no look {name!r}.", "Looks: {known}." if known else "Keep one first.", name=name, known=known
        )
    return look


def is_changed(scene: bpy.types.Scene) -> bool:
    """Tell whether the swatches have changed since the look in use was chosen or kept."""
    look = scene.karf.looks.get(scene.karf.look)
    return look is not None and look.edit != captured(scene)


def keep(scene: bpy.types.Scene, name: str) -> None:
    """Keep the current swatches as a look, a new one or over another; it is then in use."""
    look = scene.karf.looks.get(name) or scene.karf.looks.add()
    look.name, look.edit = name, captured(scene)
    _use(scene, name)


def choose(scene: bpy.types.Scene, name: str) -> None:
    """Set all swatches, locked ones too, to a look. Raises BadRequest or DataError where that is impossible."""
    edits.apply_edit(scene, edit_of(named(scene, name)), is_whole=True)
    _use(scene, name)


def _use(scene: bpy.types.Scene, name: str) -> None:
    karf = scene.karf
    if karf.look != name:
        karf.look_before, karf.look = karf.look, name


def other(scene: bpy.types.Scene) -> str:
    """Return the look to flip to: the one in use before, else the next in the list; "" where there is none."""
    karf, names = scene.karf, scene.karf.looks.keys()
    if karf.look_before in names and karf.look_before != karf.look:
        return karf.look_before
    after = names[names.index(karf.look) + 1 :] if karf.look in names else []
    return next((name for name in [*after, *names] if name != karf.look), "")


def rename(scene: bpy.types.Scene, name: str, new: str) -> None:
    """Give a look another name; the one in use remains in use."""
    named(scene, name).name = check_name(scene, new, name)
    for place in ("look", "look_before"):
        if getattr(scene.karf, place) == name:
            setattr(scene.karf, place, new)


def check_name(scene: bpy.types.Scene, new: str, old: str = "") -> str:
    """Return a new name for a look, maybe `old`. Raises BadRequest if it is empty, or makes another look's folder."""
    if not new.strip():
        raise BadRequest("A look's name is empty.", "Name it.")
    for taken in scene.karf.looks.keys():
        if taken != old and file_name(taken).casefold() == file_name(new).casefold():
            raise BadRequest(
                "{new!r} and the look {taken!r} would use the same folder.",
                "Choose another name.",
                new=new,
                taken=taken,
            )
    return new


def free_name(scene: bpy.types.Scene) -> str:
    """Return the first letter, else number, that is not the name of a look."""
    taken = {name.casefold() for name in scene.karf.looks.keys()}
    numbers = (str(number) for number in range(1, len(taken) + 2))
    return next(name for name in [*ascii_uppercase, *numbers] if name.casefold() not in taken)
