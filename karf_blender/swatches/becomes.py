"""One color of an object becomes another, from the picture as it is edited, at once while the target is dragged."""

from collections.abc import Sequence

import bpy
import numpy as np

from ..engine_api import (
    BadRequest,
    ColorHistogram,
    Edit,
    Palette,
    add_fixed_paints,
    evaluate_edit,
    match_becomes,
    match_fewest,
    nearest_weights,
    rgb_to_hex,
    shown_colors,
    srgb_to_lab,
)
from . import colors, edits, groups, shown

MOST_HELD = 8  # pairs held for an object's paints


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
        Why the target is missed, as a sentence; else nothing.

    Raises:
        BadRequest: The source is black, or the object shows no such color.
        DataError: The project's histogram of the object's colors is damaged.
    """
    item = edits.object_named(scene, name)
    seen = shown.of(scene).histogram(item)
    locked, now = groups.held(item), colors.edited(item)
    start = np.where(np.isin(np.arange(len(now)), locked)[:, None], now, start)
    visible = shown_colors(seen, Palette(name, colors.learned(item)), start)
    if not colors.is_shown(visible, seen.counts, source):
        raise BadRequest(
            "{name} shows no color like {color}.",
            "Pick the left color on the object in the displayed picture.",
            name=name,
            color=rgb_to_hex(source),
        )
    weights = groups.gathered(item, seen.palette_weights.T).T
    if rule == "fewest":
        edited = match_fewest(nearest_weights(visible, weights, source), start, target, locked, shown=source)
    else:
        pairs = add_fixed_paints(visible, source, target, held)
        edited = match_becomes(visible, seen.counts, weights, start, *pairs, locked, item.is_metal)
    edit = Edit({name: edited}, scene.karf.compositing, colors.added_by_object(scene), colors.edges(scene))
    edits.apply_edit(scene, edit)
    before = ColorHistogram(visible, seen.counts, weights)
    reached, _, reason = evaluate_edit(edited, start, before, source, srgb_to_lab(target), locked)
    return reason and f"{name} shows {rgb_to_hex(reached)} and not quite what was wanted, because {reason}."


def apply_picked(item: bpy.types.PropertyGroup) -> str:
    """`apply` with the object's own pair of colors, from the swatches as they were when its source was picked.

    So the target can be changed any number of times. Other changes made since are kept as the start, unless they have
    taken the source itself away.
    """
    now, source, target = colors.edited(item), colors.source(item), np.array(item.target, np.float32)
    is_own = (now == colors.stored(item, "after")).all()
    start = colors.picked_with(item) if is_own or not _is_shown(item, now, source) else now
    remark = apply(item.id_data, item.name, source, target, item.rule, start, colors.held(item))
    item.swatches.foreach_set("before", start.ravel())
    item.swatches.foreach_set("after", colors.edited(item).ravel())
    return remark


def _is_shown(item: bpy.types.PropertyGroup, palette: np.ndarray, color: np.ndarray) -> bool:
    """Whether an object shows a color with a palette."""
    seen = shown.of(item.id_data).histogram(item)
    return colors.is_shown(shown_colors(seen, Palette(item.name, colors.learned(item)), palette), seen.counts, color)


def picked(item: bpy.types.PropertyGroup) -> None:
    """Remember the swatches with which the picture shows the source that was just picked, and how it is exposed.

    A target that was applied is held from now on, so that paint after paint can be changed.
    """
    before, after = (colors.stored(item, name) for name in ("before", "after"))
    if (before != after).any() and (after == colors.edited(item)).all():
        given = [*colors.held(item), np.array(item.target)][-MOST_HELD:]
        item.held = " ".join(map(rgb_to_hex, given))
    item.gains = shown.of(item.id_data).gains
    for name in ("before", "after"):
        item.swatches.foreach_set(name, colors.edited(item).ravel())
