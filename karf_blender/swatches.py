"""Swatches of a scene as palettes and edits, and back.

Swatch 0 of every object is black, frozen and not shown. Colors are sRGB numbers in float32, as Blender stores them, so
a swatch never touched equals its learned color exactly.

Edits, locks and keyframes belong to an object's name and to a swatch's learned color: where palettes are replaced they
go to the swatch that has this color now, and what has no such swatch is kept in a file.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from . import folders, job_watch, keyframes, recolor
from .engine_api import (
    BadRequest,
    DataError,
    Edit,
    KarfError,
    Palette,
    hex_to_rgb,
    read_palettes,
    rgb_to_hex,
    srgb_to_lab,
    write_edit,
)

NEAR = 20.0  # a learned color this far from another in CIE L*a*b* may still be the same swatch's


@dataclass(frozen=True)
class _Known:
    """What the artist has done to an object: swatches by number, and the object's own values by name."""

    learned: np.ndarray
    colors: np.ndarray
    locked: tuple[bool, ...]
    own: dict

    @classmethod
    def of(cls, item: bpy.types.PropertyGroup) -> "_Known":
        own = {name: getattr(item, name) for name in ("rule", "show_becomes")}
        own |= {name: tuple(getattr(item, name)) for name in ("source", "target")}
        locked = tuple(swatch.locked for swatch in item.swatches)
        return cls(recolor.learned_colors(item), recolor.edited_colors(item), locked, own)

    @property
    def touched(self) -> set[int]:
        """The swatches that are edited or locked."""
        edited = (self.colors != self.learned).any(axis=-1)
        return {index for index in range(1, len(edited)) if edited[index] or self.locked[index]}


def load_palettes(scene: bpy.types.Scene, palettes: Sequence[Palette]) -> None:
    """Replace the scene's objects and swatches by these learned palettes. Edits, locks and keyframes go along.

    What cannot go along is kept as an edit file in the project, and a warning names it. Raises DataError where that
    cannot be written; then all stays as it was.
    """
    known = {item.name: _Known.of(item) for item in scene.karf.objects}
    colors = {palette.name: palette.colors for palette in palettes}
    places = {name: _places(each.learned, colors.get(name)) for name, each in known.items()}
    lost = [name for name, each in known.items() if each.touched - set(places[name])]
    if lost:
        _keep(scene, lost)
    keyframes.make_own(scene)
    curves = keyframes.of(scene)
    with recolor.held(scene):
        scene.karf.objects.clear()
        for palette in palettes:
            _add(scene, palette, known.get(palette.name), places.get(palette.name, {}))
        numbers = {name: number for number, name in enumerate(scene.karf.objects.keys())}
        for curve in curves:
            keyframes.move(curve, numbers, _swatch_of(curve, known, places, colors))


def _add(scene: bpy.types.Scene, palette: Palette, known: _Known | None, places: dict[int, int]) -> None:
    """Add an object; places: the new number of each of its known swatches that is still there."""
    item = scene.karf.objects.add()
    item.name = palette.name
    for index, color in enumerate(palette.colors):
        swatch = item.swatches.add()
        swatch.name = f"Color {index}" if index else "Black"
        swatch.learned = swatch.color = color
        swatch.locked = index == 0
    item.source = item.target = palette.colors[min(1, len(palette.colors) - 1)]
    if known is None:
        return
    for name, value in known.own.items():
        setattr(item, name, value)
    for old in known.touched & set(places):
        swatch = item.swatches[places[old]]
        swatch.locked = known.locked[old]
        if (known.colors[old] != known.learned[old]).any():
            swatch.color = known.colors[old]


def _places(old: np.ndarray, new: np.ndarray | None) -> dict[int, int]:
    """Where the swatches of a palette [n, 3] are in another [m, 3]: the nearest pairs first, each swatch in one of them."""
    if new is None:
        return {}
    distances = np.linalg.norm(srgb_to_lab(old)[:, None] - srgb_to_lab(new)[None], axis=-1)
    distances[0], distances[:, 0] = np.inf, np.inf  # black is black
    places = {0: 0}
    for flat in distances.argsort(axis=None, kind="stable"):
        source, target = divmod(int(flat), len(new))
        if distances[source, target] > NEAR:
            break
        if source not in places and target not in places.values():
            places[source] = target
    return places


def _swatch_of(
    curve: keyframes.Curve, known: dict[str, _Known], places: dict[str, dict[int, int]], colors: dict[str, np.ndarray]
) -> int | str | None:
    """The number of a curve's swatch in the new palettes, or its learned color where there is no such swatch."""
    name, swatch = curve.object_name, curve.swatch
    if isinstance(swatch, int):
        learned = known[name].learned if name in known else ()
        return places[name].get(swatch, rgb_to_hex(learned[swatch])) if swatch < len(learned) else swatch
    if swatch is None or name not in colors:
        return swatch
    # a curve that waited takes a swatch that no other has
    black_and_waiting = np.stack([np.zeros(3), hex_to_rgb(swatch)])
    found = _places(black_and_waiting, colors[name]).get(1)
    return swatch if found is None or found in places.get(name, {}).values() else found


def _keep(scene: bpy.types.Scene, lost: Sequence[str]) -> None:
    """Write the swatches as they stand to a new edit file, and say so. Raises DataError where it cannot be written."""
    folder = folders.project_of(scene).folder / "edits"
    stamp, number = time.strftime("%Y%m%d-%H%M%S"), 2
    file = folder / f"kept-{stamp}.json"
    while file.exists():
        file, number = folder / f"kept-{stamp}-{number}.json", number + 1
    try:
        write_edit(file, current_edit(scene))
    except OSError as error:
        raise DataError(
            f"The edits could not be kept in {file} ({error}), so the palettes stay as they were.",
            "Make room there, then choose the project again.",
        ) from error
    job_watch.warn(
        f"Edited swatches of {', '.join(lost)} are no longer in the palettes. All edits as they were are in {file}; "
        "keyframes wait in the scene's action."
    )


def has_edits(scene: bpy.types.Scene) -> bool:
    """True if a swatch of the scene is edited, locked or animated."""
    return any(_Known.of(item).touched for item in scene.karf.objects) or bool(keyframes.of(scene))


def take_over(scene: bpy.types.Scene) -> None:
    """Bring what the scene's project has learned: its masks, and its palettes where the scene has others; never raises.

    Edits of the same palettes are kept, for those of others see `load_palettes`.
    """
    if not scene.karf.project:
        return
    project = folders.project_of(scene)
    try:
        if not scene.karf.masks and project.masks_folder.is_dir():
            scene.karf.masks = folders.stored(project.masks_folder)
        if not project.palette_file.exists():  # nothing was learned yet
            return
        palettes = read_palettes(project.checked(project.palette_file))
        if [_key(palette) for palette in palettes] != [_key(palette) for palette in learned(scene)]:
            recolor.forget()
            load_palettes(scene, palettes)
    except KarfError as error:
        job_watch.warn(f"{error.sentence} {error.hint}")
    except OSError as error:
        job_watch.warn(f"{project.folder} cannot be read: {error}.")


def _key(palette: Palette) -> tuple[str, bytes]:
    return palette.name, palette.colors.astype(np.float32).tobytes()


def learned(scene: bpy.types.Scene) -> tuple[Palette, ...]:
    """The palettes as learned."""
    return tuple(Palette(item.name, recolor.learned_colors(item)) for item in scene.karf.objects)


def current_edit(scene: bpy.types.Scene) -> Edit:
    """The palettes as the swatches stand now."""
    colors = {item.name: recolor.edited_colors(item) for item in scene.karf.objects}
    return Edit(colors, scene.karf.compositing)


def apply_edit(scene: bpy.types.Scene, edit: Edit) -> None:
    """Set the swatches to an edit of these objects; objects that it leaves out stay as they are."""
    with recolor.held(scene):
        scene.karf.compositing = edit.compositing
        for name, colors in edit.colors.items():
            for swatch, color in zip(object_named(scene, name).swatches, colors, strict=True):
                swatch.color = color


def set_color(scene: bpy.types.Scene, name: str, index: int, color: Sequence[float] | np.ndarray) -> None:
    """Set one swatch of an object; index counts from 1, since swatch 0 is black."""
    swatch_at(scene, name, index).color = color


def reset(scene: bpy.types.Scene, name: str, index: int | None = None) -> None:
    """Give one swatch of an object (None: all) its learned color back."""
    chosen = object_named(scene, name).swatches if index is None else [swatch_at(scene, name, index)]
    with recolor.held(scene):
        for swatch in chosen:
            swatch.color = swatch.learned


def object_named(scene: bpy.types.Scene, name: str) -> bpy.types.PropertyGroup:
    """The scene's object with this name. Raises BadRequest listing those there are."""
    item = scene.karf.objects.get(name)
    if item is None:
        known = ", ".join(scene.karf.objects.keys())
        raise BadRequest(
            f"The scene has no object {name!r}.", f"Objects: {known}." if known else "Extract the palettes first."
        )
    return item


def swatch_at(scene: bpy.types.Scene, name: str, index: int) -> bpy.types.PropertyGroup:
    """Swatch `index` of an object. Raises BadRequest where there is none, or where it is the frozen black."""
    found = object_named(scene, name).swatches
    if not 1 <= index < len(found):
        raise BadRequest(
            f"Object {name!r} has no swatch {index}.", f"Swatches count from 1 to {len(found) - 1}; black is frozen."
        )
    return found[index]
