"""Learned palettes become a scene's objects and swatches, also where it has others already."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
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
    dominant_color,
    file_name,
    hex_to_rgb,
    object_paints,
    read_palettes,
    rgb_to_hex,
    srgb_to_lab,
    write_edit,
)
from ..project import folders
from . import colors, displayed, edits, gestures, groups, keyframes, looks
from .solving import NEUTRAL, PaletteState

NEAR = 20.0  # largest CIE L*a*b* distance between learned colors of one swatch
OWN_VALUES = ("scope", "show_becomes", "held", "is_metal", "choke", "feather", "show_edge")


@dataclass(frozen=True)
class _ObjectEdits:
    """The artist's edits of an object: its swatches, and its own values by name."""

    state: PaletteState
    own: dict

    @classmethod
    def of(cls, item: bpy.types.PropertyGroup) -> "_ObjectEdits":
        own = {name: getattr(item, name) for name in OWN_VALUES}
        source, target = colors.color_pair(item)
        if source != target:  # else it waits for a target, with the color that the object mostly had
            own |= {"source": source, "target": target, "gains": tuple(item.gains)}
        return cls(colors.state(item), own)

    @property
    def touched(self) -> set[int]:
        """The numbers of edited, locked, linked, merged and added swatches."""
        state = self.state
        has_color, has_surface = state.chosen != state.learned, state.surface != NEUTRAL
        touched = (has_color | has_surface).any(axis=-1) | state.locked | (state.link > 0) | (state.merged > 0)
        own = set(np.flatnonzero(touched[: state.size]).tolist()) - {0}
        return own | set(np.flatnonzero(state.is_added & ~state.idle).tolist())

    @property
    def has_sets(self) -> bool:
        """True if it has added colors or changed paints."""
        return bool((self.state.is_added & ~self.state.idle).any())

    @property
    def has_edge(self) -> bool:
        """True if its edge is moved or faded."""
        return bool(self.own["choke"] or self.own["feather"])

    def added_places(self, size: int) -> range:
        """Return the numbers of its added colors behind `size` learned swatches."""
        return range(size, size * (1 + self.has_sets * len(self.state.added)), size)

    def match(self, new: np.ndarray | None) -> dict[int, int]:
        """Return the numbers of its swatches in another palette [m, 3] with the same added colors, by their own."""
        if new is None:
            return {}
        size = self.state.size
        added = zip(self.added_places(size), self.added_places(len(new)), strict=True)
        return _match_swatches(self.state.palette.colors, new) | dict(added)


def load_palettes(scene: bpy.types.Scene, palettes: Sequence[Palette]) -> None:
    """Replace the scene's objects and swatches by these learned palettes. Edits, looks, locks and keyframes go along.

    They go to the swatch whose learned color is nearest; others are saved to an edit file, which a warning names.
    Raises DataError if that file cannot be written; then nothing is replaced.
    """
    before = _edits_of(scene)
    after = {palette.name: palette.colors for palette in palettes}
    lost = [
        name
        for name, each in before.items()
        if each.touched - set(each.match(after.get(name))) or (each.has_edge and name not in after)
    ]
    if lost:
        progress.warn(
            Message(
                "The palettes no longer have some edited swatches of {names}. A copy of all edits is in {file}; "
                "keyframes remain in the scene's action.",
                names=", ".join(lost),
                file=_write_kept(scene, edits.current_edit(scene)),
            )
        )
    kept = looks.readable(scene)
    for name, edit in kept.items():
        _keep_look(scene, name, edit, before, after)
    keyframes.copy_shared_action(scene)
    curves = keyframes.of(scene)
    with displayed.batched(scene), gestures.suspended(scene):
        states = {}
        for name, edit in kept.items():
            edits.apply_edit(scene, edit, is_whole=True)
            states[name] = _edits_of(scene)
        for name, state in states.items():
            _replace(scene, palettes, state)
            scene.karf.looks[name].edit = looks.captured(scene)
        _replace(scene, palettes, before)
        if not palettes:  # no objects, no looks of them
            scene.karf.looks.clear()
            scene.karf.look = scene.karf.look_before = ""
        numbers = {name: number for number, name in enumerate(scene.karf.objects.keys())}
        for curve in curves:
            keyframes.move(curve, numbers, _swatch_of(curve, before, after))


def _edits_of(scene: bpy.types.Scene) -> dict[str, _ObjectEdits]:
    return {item.name: _ObjectEdits.of(item) for item in scene.karf.objects}


def _replace(scene: bpy.types.Scene, palettes: Sequence[Palette], before: dict[str, _ObjectEdits]) -> None:
    """Give the scene the objects of these palettes, with the edits of those it had."""
    scene.karf.objects.clear()
    for palette in palettes:
        item = scene.karf.objects.add()
        item.name = palette.name
        for index, color in enumerate(palette.colors):
            swatch = item.swatches.add()
            swatch.name = f"Color {index}" if index else "Black"
            swatch.learned = swatch.color = color
            swatch.locked = index == 0
        item.source = item.target = _main_color(scene, palette)
        item.gains = UNIT_GAINS
        if palette.name not in before or not before[palette.name].has_sets:
            for color in _paints(scene, palette):
                groups.add_color(item, color, is_paint=True)
        if palette.name in before:
            _restore(item, before[palette.name], palette)


def _restore(item: bpy.types.PropertyGroup, before: _ObjectEdits, palette: Palette) -> None:
    """Give a new object the edits of the one that it replaces."""
    for name, value in before.own.items():
        setattr(item, name, value)
    state, matches = before.state, before.match(palette.colors)
    for index in np.flatnonzero(state.is_added) if before.has_sets else ():
        color = replace(state.added_color(index), reach=float(state.reach[index]))
        groups.add_color(item, color, is_paint=bool(state.is_paint[index]))
    for old in before.touched & set(matches):
        swatch = item.swatches[matches[old]]
        swatch.locked, swatch.link = bool(state.locked[old]), int(state.link[old])
        swatch.merged = matches.get(int(state.merged[old]), 0)
        if (state.chosen[old] != state.learned[old]).any():
            swatch.color = state.chosen[old]
        colors.write_surface(swatch, state.surface_of(old))
        if swatch.is_added:
            scene = item.id_data
            solved = gestures.solve_sets(scene, colors.states(scene), item.name, matches[old])
            colors.write(item, solved[item.name].chosen)


def _paints(scene: bpy.types.Scene, palette: Palette) -> Sequence[AddedColor]:
    """Return the paints of an object; none where its colors were not counted."""
    try:
        return object_paints(displayed.of(scene).learned_histogram(palette.name))
    except (KarfError, OSError):
        return ()


def _main_color(scene: bpy.types.Scene, palette: Palette) -> np.ndarray:
    """Return the color of an object's main paint, [3], or its most frequent one; its first swatch's if not counted."""
    try:
        paints = _paints(scene, palette)
        if paints:
            return paints[0].picked
        return dominant_color(displayed.of(scene).learned_histogram(palette.name))
    except (KarfError, OSError):
        return palette.colors[min(1, len(palette.colors) - 1)]


def _match_swatches(old: np.ndarray, new: np.ndarray) -> dict[int, int]:
    """Pair the swatches of a palette [n, 3] with those of another [m, 3], nearest first."""
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
    curve: keyframes.Curve, before: dict[str, _ObjectEdits], after: dict[str, np.ndarray]
) -> int | str | None:
    """Return the number of a curve's swatch in the new palettes, or its learned color where it has no place there."""
    name, swatch = curve.object_name, curve.swatch
    matches = before[name].match(after.get(name)) if name in before else {}
    if isinstance(swatch, int):
        learned = before[name].state.learned if name in before else ()
        return matches.get(swatch, rgb_to_hex(learned[swatch])) if swatch < len(learned) else swatch
    if swatch is None or name not in after:
        return swatch
    # a curve that waits takes only a swatch that had no place before
    black_and_waiting = np.stack([np.zeros(3), hex_to_rgb(swatch)])
    found = _match_swatches(black_and_waiting, after[name]).get(1)
    return swatch if found is None or found in matches.values() else found


def _keep_look(
    scene: bpy.types.Scene, name: str, edit: Edit, before: dict[str, _ObjectEdits], after: dict[str, np.ndarray]
) -> None:
    """Write a look to a new edit file where colors of it have no place in the new palettes, and warn."""
    lost = []
    for item, edited in edit.colors.items():
        learned, matches = before[item].state.palette.colors, before[item].match(after.get(item))
        changed = np.flatnonzero((edited[: len(learned)] != learned).any(axis=-1)).tolist()
        has_more = item in edit.added or item in edit.edges
        if set(changed) - set(matches) or (has_more and not matches):
            lost.append(item)
    if lost:
        progress.warn(
            Message(
                "The palettes no longer have some colors of {names} in the look {look}. A copy of the look is "
                "in {file}.",
                names=", ".join(lost),
                look=name,
                file=_write_kept(scene, edit, f"-{file_name(name)}"),
            )
        )


def _write_kept(scene: bpy.types.Scene, edit: Edit, mark: str = "") -> Path:
    """Write an edit to a new file of the project, whose name ends in a mark. Raises DataError where that fails."""
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
    return any(each.touched or each.has_edge for each in _edits_of(scene).values()) or bool(keyframes.of(scene))


def import_learned(scene: bpy.types.Scene) -> None:
    """Import what the scene's project has learned: masks, and palettes where the scene has others; never raises."""
    if not scene.karf.project:
        return
    project = folders.project_of(scene)
    try:
        if not scene.karf.masks and project.masks_folder.is_dir():
            folders.store(scene, "masks", project.masks_folder)
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
