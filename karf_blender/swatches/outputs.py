"""Names of recolored files: the setting File Names, where nothing of another look or of other swatches is in the way."""

import re
from collections.abc import Sequence
from itertools import count
from pathlib import Path

import bpy

from ..engine_api import (
    KINDS,
    BadRequest,
    Edit,
    FinishedFrames,
    edit_from_json,
    edit_to_json,
    file_name,
    file_paths,
    frame_fingerprint,
    named,
    tokens_of,
)
from ..pictures import sequences
from . import colors, looks

DEFAULT = "{look}/{view}"
NOT_KEPT = "Recolored"  # name of swatches that are not a look
OWN = (*KINDS, "cameras", "edits", "colorways", "farm", "page")  # other folders in the output folder


def look_of(scene: bpy.types.Scene) -> str:
    """Return the look that the swatches are, or else `NOT_KEPT`."""
    look = scene.karf.look
    return look if look in scene.karf.looks and not looks.is_changed(scene) else NOT_KEPT


def folder_name(look: str) -> str:
    """Return a look's name as a file name that no other folder of the output folder has."""
    name = file_name(look)
    return f"{name}_" if name.lower() in OWN else name


def pattern_of(scene: bpy.types.Scene, look: str = "{look}") -> str:
    """Return the file names of a look's pictures, in which the tokens of a view are left."""
    return named(scene.karf.file_names, {"look": look, "scene": file_name(scene.name)})


def shown_path(scene: bpy.types.Scene) -> str:
    """Return the usual path of the active view's picture in the output folder, without suffix."""
    return named(pattern_of(scene, folder_name(look_of(scene))), tokens_of(scene.karf.active_view))


def free_look(
    scene: bpy.types.Scene, folder: Path, views: Sequence[str], made_by: Sequence[Edit], look: str = ""
) -> str:
    """Return the value of the token {look}: a look's name, numbered where pictures of other edits have its paths.

    Args:
        folder: The output folder.
        views: Names of the views.
        made_by: Their edits, or one for all.
        look: Default: that of the swatches.

    Raises:
        BadRequest: The file names are impossible.
    """
    karf, own = scene.karf, look or look_of(scene)
    by_edit = {id(edit): frame_fingerprint("", as_read(scene, edit)) for edit in made_by}
    marks = [by_edit[id(edit)] for edit in made_by] * (len(views) if len(made_by) == 1 else 1)
    known = FinishedFrames.read(folder).edits()
    others = {folder_name(name).casefold() for name in karf.looks.keys() if name != own}
    for number in count(1):
        name = folder_name(own) if number == 1 else f"{folder_name(own)}_{number}"
        tokens = [{"look": name, "scene": file_name(scene.name), **tokens_of(view)} for view in views]
        paths = file_paths(karf.file_names, tokens)
        is_taken = name.casefold() in others or any(
            known.get(path) != mark and sequences.newest(folder / path) is not None
            for path, mark in zip(paths, marks, strict=True)
        )
        if karf.overwrite or not is_taken:
            return name
        if "{look}" not in karf.file_names:
            raise BadRequest(
                "{folder} has pictures of other swatches under the same names.",
                "Add {look} to File Names, or tick Overwrite.",
                folder=folder,
            )
    raise AssertionError


def folder_of(frames: Path) -> Path:
    """Return the folder of all pictures whose paths are a pattern, or a folder itself."""
    parts = (frames, *frames.parents)
    return next(part for part in parts if not {"{view}", "{frame}"} & set(re.findall(r"{\w+}", str(part))))


def as_read(scene: bpy.types.Scene, edit: Edit) -> Edit:
    """Return an edit as the engine reads it from a file."""
    return edit_from_json(edit_to_json(edit), "the swatches", colors.palettes(scene), scene.karf.compositing)
