"""One color of an object becomes another, from the picture as it is edited, at once while the target is dragged."""

from collections.abc import Sequence

import bpy
import numpy as np

from ..engine_api import (
    ColorHistogram,
    Edit,
    Palette,
    ciede2000,
    hex_to_rgb,
    match_becomes,
    match_fewest,
    nearest_weights,
    reached_by,
    rgb_to_hex,
    shown_colors,
    srgb_to_lab,
    with_held,
)
from . import colors, edits, groups, shown

MOST_HELD = 8  # pairs held for an object's paints
FOREIGN = 10.0  # CIEDE2000 from which an object shows no such color


def apply(
    scene: bpy.types.Scene,
    name: str,
    source: np.ndarray,
    target: np.ndarray,
    rule: str,
    start: np.ndarray,
    held: Sequence[np.ndarray] = (),
) -> str:
    """Set an object's swatches so that one color of it becomes another; locked swatches stay.

    Args:
        scene: The scene.
        name: The object's.
        source: A color that it shows with the palette `start`, sRGB [3] in [0, 1].
        target: What this one is to become.
        rule: `becomes` or `fewest`.
        start: The palette to start from, [M, 3].
        held: Colors that other paints of the object were given with `start` and keep, sRGB [3] each; of `becomes`.

    Returns:
        What is odd about the source, or why the target is missed, as a sentence; else nothing.

    Raises:
        BadRequest: The source is black.
        DataError: The project's histogram of the object's colors is damaged.
    """
    item = edits.object_named(scene, name)
    seen = shown.of(scene).histogram(item)
    locked, now = groups.held(item), colors.edited(item)
    start = np.where(np.isin(np.arange(len(now)), locked)[:, None], now, start)
    visible = shown_colors(seen, Palette(name, colors.learned(item)), start)
    weights = groups.gathered(item, seen.palette_weights.T).T
    if rule == "fewest":
        edited = match_fewest(nearest_weights(visible, weights, source), start, target, locked, shown=source)
    else:
        pairs = with_held(visible, source, target, held)
        edited = match_becomes(visible, seen.counts, weights, start, *pairs, locked)
    edits.apply_edit(scene, Edit({name: edited}, scene.karf.compositing, colors.added_by_object(scene)))
    distance = ciede2000(srgb_to_lab(visible), srgb_to_lab(source)).min()
    if distance > FOREIGN:
        return f"{name} shows no color like {rgb_to_hex(source)}: the nearest differs by CIEDE2000 {distance:.0f}. Pick it anew."
    before = ColorHistogram(visible, seen.counts, weights)
    reached, left, reason = reached_by(edited, Palette(name, start), before, source, srgb_to_lab(target), locked)
    return (
        reason and f"{name} shows {rgb_to_hex(reached)}, CIEDE2000 {left:.0f} from what was wanted, because {reason}."
    )


def apply_picked(item: bpy.types.PropertyGroup) -> str:
    """`apply` with the object's own pair of colors, from the swatches as they were when its source was picked.

    So the target can be changed any number of times. Other changes made since are kept as the start.
    """
    now = colors.edited(item)
    start = colors.stored(item, "before") if (now == colors.stored(item, "after")).all() else now
    source, target = (np.array(color, np.float32) for color in (item.source, item.target))
    remark = apply(item.id_data, item.name, source, target, item.rule, start, _held(item))
    item.swatches.foreach_set("before", start.ravel())
    item.swatches.foreach_set("after", colors.edited(item).ravel())
    return remark


def picked(item: bpy.types.PropertyGroup) -> None:
    """Remember the swatches with which the picture shows the source that was just picked.

    A target that was applied is held from now on, so that paint after paint can be changed.
    """
    before, after = (colors.stored(item, name) for name in ("before", "after"))
    if (before != after).any() and (after == colors.edited(item)).all():
        given = [*_held(item), np.array(item.target)][-MOST_HELD:]
        item.held = " ".join(map(rgb_to_hex, given))
    for name in ("before", "after"):
        item.swatches.foreach_set(name, colors.edited(item).ravel())


def _held(item: bpy.types.PropertyGroup) -> list[np.ndarray]:
    return [hex_to_rgb(text) for text in item.held.split()]
