"""Learned palettes become a scene's objects and swatches, also where it has others already.

Edits, locks and keyframes belong to an object's name and to a swatch's learned color: where palettes are replaced they
go to the swatch that has this color now, and what has no such swatch is kept in a file.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from .. import progress
from ..engine_api import (
    UNIT_GAINS,
    AddedColor,
    DataError,
    Edit,
    KarfError,
    Message,
    Palette,
    Surface,
    dominant_color,
    file_name,
    hex_to_rgb,
    read_palettes,
    rgb_to_hex,
    srgb_to_lab,
    write_edit,
)
from ..project import folders
from . import colors, displayed, edits, gestures, groups, keyframes, looks

NEAR = 20.0  # CIE L*a*b* distance up to which two learned colors may be the same swatch's


@dataclass(frozen=True)
class _ObjectEdits:
    """What the artist has done to an object: swatches by number, its added colors, and the object's own values by name."""

    added: tuple[AddedColor, ...]
    learned: np.ndarray
    colors: np.ndarray
    locked: tuple[bool, ...]
    links: tuple[int, ...]
    merged: tuple[int, ...]
    surfaces: tuple[Surface, ...]
    own: dict

    @classmethod
    def of(cls, item: bpy.types.PropertyGroup) -> "_ObjectEdits":
        kept = ("rule", "show_becomes", "held", "is_metal", "choke", "feather", "show_edge")
        own = {name: getattr(item, name) for name in kept}
        source, target = colors.color_pair(item)
        if source != target:  # else it waits for a target, with the color that the object mostly had
            own |= {"source": source, "target": target, "gains": tuple(item.gains)}
        flags = [(swatch.locked, swatch.link, swatch.merged, colors.surface_of(swatch)) for swatch in item.swatches]
        return cls(colors.added(item), colors.learned(item), colors.chosen(item), *zip(*flags, strict=True), own)

    @property
    def size(self) -> int:
        """How many swatches were learned."""
        return len(self.learned) // (1 + len(self.added))

    @property
    def touched(self) -> set[int]:
        """The swatches that are edited, locked, move with others or were added."""
        edited = (self.colors != self.learned).any(axis=-1)
        has_surface = [not surface.is_neutral for surface in self.surfaces]
        kept = list(zip(edited, self.locked, self.links, self.merged, has_surface, strict=True))[: self.size]
        return {index for index, each in enumerate(kept) if index and any(each)} | set(self.places(self.size))

    @property
    def has_edge(self) -> bool:
        """Whether its edge is moved or faded."""
        return bool(self.own["choke"] or self.own["feather"])

    def places(self, size: int) -> range:
        """Where added colors are behind `size` learned swatches."""
        return range(size, size * (1 + len(self.added)), size)


def load_palettes(scene: bpy.types.Scene, palettes: Sequence[Palette]) -> None:
    """Replace the scene's objects and swatches by these learned palettes. Edits, looks, locks and keyframes go along.

    What cannot go along is kept as an edit file in the project, and a warning names it.

    Raises:
        DataError: That file cannot be written; then all stays as it was.
    """
    before = {item.name: _ObjectEdits.of(item) for item in scene.karf.objects}
    after = {palette.name: palette.colors for palette in palettes}
    matches = {name: _match(each, after.get(name)) for name, each in before.items()}
    lost = [
        name
        for name, each in before.items()
        if each.touched - set(matches[name]) or (each.has_edge and name not in after)
    ]
    if lost:
        _keep(scene, lost)
    kept = looks.readable(scene)
    for name, edit in kept.items():
        _keep_look(scene, name, edit, before, matches)
    keyframes.copy_shared_action(scene)
    curves = keyframes.of(scene)
    with displayed.batched(scene), gestures.suspended(scene):
        states = {name: _state(scene, edit) for name, edit in kept.items()}
        for name, state in states.items():
            _replace(scene, palettes, state)
            scene.karf.looks[name].edit = looks.captured(scene)
        _replace(scene, palettes, before)
        if not palettes:
            looks.forget(scene)
        numbers = {name: number for number, name in enumerate(scene.karf.objects.keys())}
        for curve in curves:
            keyframes.move(curve, numbers, _swatch_of(curve, before, matches, after))


def _state(scene: bpy.types.Scene, edit: Edit) -> dict[str, _ObjectEdits]:
    """What an edit of the scene's palettes does to its objects, which have it then."""
    edits.apply_edit(scene, edit, is_whole=True)
    return {item.name: _ObjectEdits.of(item) for item in scene.karf.objects}


def _replace(scene: bpy.types.Scene, palettes: Sequence[Palette], before: dict[str, _ObjectEdits]) -> None:
    """Give the scene the objects of these palettes, with what was done to those it had."""
    scene.karf.objects.clear()
    for palette in palettes:
        own = before.get(palette.name)
        _add(scene, palette, own, _match(own, palette.colors) if own else {})


def _add(scene: bpy.types.Scene, palette: Palette, before: _ObjectEdits | None, matches: dict[int, int]) -> None:
    """Add an object.

    Args:
        scene: The scene.
        palette: The object's palette as learned.
        before: What the artist had done to it, if it was there.
        matches: The new number of each of its former swatches that is still there.
    """
    item = scene.karf.objects.add()
    item.name = palette.name
    for index, color in enumerate(palette.colors):
        swatch = item.swatches.add()
        swatch.name = f"Color {index}" if index else "Black"
        swatch.learned = swatch.color = color
        swatch.locked = index == 0
    item.source = item.target = _mostly(scene, palette)
    item.gains = UNIT_GAINS
    if before is None:
        return
    for name, value in before.own.items():
        setattr(item, name, value)
    for color in before.added:
        groups.add_color(item, color)
    for old in before.touched & set(matches):
        swatch = item.swatches[matches[old]]
        swatch.locked, swatch.link = before.locked[old], before.links[old]
        swatch.merged = matches.get(before.merged[old], 0)
        if (before.colors[old] != before.learned[old]).any():
            swatch.color = before.colors[old]
        colors.write_surface(swatch, before.surfaces[old])
        if swatch.is_added:
            colors.write(
                item, gestures.solve_sets(scene, colors.states(scene), item.name, matches[old])[item.name].chosen
            )


def _mostly(scene: bpy.types.Scene, palette: Palette) -> np.ndarray:
    """The color that an object mostly has, [3]; its first swatch's where nobody has counted."""
    try:
        return dominant_color(displayed.of(scene).learned_histogram(palette.name))
    except (KarfError, OSError):
        return palette.colors[min(1, len(palette.colors) - 1)]


def _match(before: _ObjectEdits, new: np.ndarray | None) -> dict[int, int]:
    """Where an object's swatches are in another palette [m, 3], and its added colors behind that."""
    if new is None:
        return {}
    learned = _match_swatches(before.learned[: before.size], new)
    return learned | dict(zip(before.places(before.size), before.places(len(new)), strict=True))


def _match_swatches(old: np.ndarray, new: np.ndarray) -> dict[int, int]:
    """Where the swatches of a palette [n, 3] are in another [m, 3]: nearest pairs first, each swatch in one pair."""
    distances = np.linalg.norm(srgb_to_lab(old)[:, None] - srgb_to_lab(new)[None], axis=-1)
    distances[0], distances[:, 0] = np.inf, np.inf  # black is black
    matches = {0: 0}
    for flat in distances.argsort(axis=None, kind="stable"):
        source, target = divmod(int(flat), len(new))
        if distances[source, target] > NEAR:
            break
        if source not in matches and target not in matches.values():
            matches[source] = target
    return matches


def _swatch_of(
    curve: keyframes.Curve,
    before: dict[str, _ObjectEdits],
    matches: dict[str, dict[int, int]],
    after: dict[str, np.ndarray],
) -> int | str | None:
    """The number of a curve's swatch in the new palettes, or its learned color where there is no such swatch."""
    name, swatch = curve.object_name, curve.swatch
    if isinstance(swatch, int):
        learned = before[name].learned if name in before else ()
        return matches[name].get(swatch, rgb_to_hex(learned[swatch])) if swatch < len(learned) else swatch
    if swatch is None or name not in after:
        return swatch
    # a curve that waited takes a swatch that no other has
    black_and_waiting = np.stack([np.zeros(3), hex_to_rgb(swatch)])
    found = _match_swatches(black_and_waiting, after[name]).get(1)
    return swatch if found is None or found in matches.get(name, {}).values() else found


def _keep_look(
    scene: bpy.types.Scene,
    name: str,
    edit: Edit,
    before: dict[str, _ObjectEdits],
    matches: dict[str, dict[int, int]],
) -> None:
    """Write a look to a new edit file where colors of it have no place in the new palettes, and say so. Raises DataError
    where it cannot be written."""
    more = {*edit.added, *edit.edges}
    lost = [
        item
        for item, edited in edit.colors.items()
        if _changed(edited, before[item]) - set(matches[item]) or (item in more and not matches[item])
    ]
    if lost:
        file = _write_kept(scene, edit, f"-{file_name(name)}")
        progress.warn(
            Message(
                "The palettes no longer have some colors of {names} in the look {look}. A copy of the look is "
                "in {file}.",
                names=", ".join(lost),
                look=name,
                file=file,
            )
        )


def _changed(edited: np.ndarray, item: _ObjectEdits) -> set[int]:
    """The swatches of an object to which an edit [M, 3] gives another color than the learned one."""
    return set(np.flatnonzero((edited[: item.size] != item.learned[: item.size]).any(axis=-1)).tolist())


def _keep(scene: bpy.types.Scene, lost: Sequence[str]) -> None:
    """Write the swatches as they stand to a new edit file, and say so. Raises DataError where it cannot be written."""
    file = _write_kept(scene, edits.current_edit(scene))
    progress.warn(
        Message(
            "The palettes no longer have some edited swatches of {names}. A copy of all edits is in {file}; "
            "keyframes remain in the scene's action.",
            names=", ".join(lost),
            file=file,
        )
    )


def _write_kept(scene: bpy.types.Scene, edit: Edit, mark: str = "") -> Path:
    """Write an edit to a new file of the project, whose name ends in a mark. Raises DataError where it cannot be."""
    project = folders.project_of(scene)
    stamp, number = time.strftime("%Y%m%d-%H%M%S") + mark, 2
    file = project.path("edits", f"kept-{stamp}.json")
    while file.exists():
        file, number = project.path("edits", f"kept-{stamp}-{number}.json"), number + 1
    try:
        write_edit(file, edit)
    except OSError as error:
        raise DataError(
            "The edits could not be saved to {file} ({error}), so the palettes were not replaced.",
            "Free some space there, then choose the project again.",
            file=file,
            error=error,
        ) from error
    return file


def has_edits(scene: bpy.types.Scene) -> bool:
    """True if a swatch of the scene is edited, locked or animated, or an edge moved or faded."""
    return (
        bool(colors.edges(scene))
        or any(_ObjectEdits.of(item).touched for item in scene.karf.objects)
        or bool(keyframes.of(scene))
    )


def import_learned(scene: bpy.types.Scene) -> None:
    """Import what the scene's project has learned: masks, and palettes where the scene has others; never raises.

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
        palettes = read_palettes(project.verified(project.palette_file))
        if [_key(palette) for palette in palettes] != [_key(palette) for palette in colors.palettes(scene)]:
            displayed.forget(scene)
            load_palettes(scene, palettes)
    except KarfError as error:
        progress.warn(error.message)
    except OSError as error:
        progress.warn(Message("{path} cannot be read: {reason}.", path=project.folder, reason=error))


def _key(palette: Palette) -> tuple[str, bytes]:
    return palette.name, palette.colors.astype(np.float32).tobytes()
