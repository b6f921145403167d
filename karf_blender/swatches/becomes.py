"""One color of an object becomes another, from the picture as it is edited, at once while the target is dragged."""

from dataclasses import replace

import bpy
import numpy as np

from ..engine_api import Edit, rgb_to_hex
from . import colors, displayed, edits, solving
from .solving import Becoming

MOST_HELD = 8  # pairs held for an object's paints


def apply(item: bpy.types.PropertyGroup, pair: Becoming) -> str:
    """Set an object's swatches so that one color of it becomes another; locked swatches stay.

    Returns:
        Why the target is missed, as a sentence; else nothing.

    Raises:
        BadRequest: The source is black, or the object shows no such color.
        DataError: The project's histogram of the object's colors is damaged.
    """
    scene = item.id_data
    wanted, missed = solving.become(colors.state(item), pair, displayed.of(scene).histogram(item))
    edit = Edit({item.name: wanted}, scene.karf.compositing, colors.added_by_object(scene), colors.edges(scene))
    edits.apply_edit(scene, edit)
    return missed


def apply_picked(item: bpy.types.PropertyGroup) -> str:
    """`apply` with the object's own pair of colors, from the swatches as they were when its source was picked.

    So the target can be changed any number of times. Other changes made since are kept as the start, unless they have
    taken the source itself away.
    """
    state, pair = colors.state(item), colors.becoming(item)
    if (state.edited != colors.stored(item, "after")).any():
        seen = displayed.of(item.id_data).histogram(item)
        if solving.is_shown(state.visible(seen, state.edited), seen.counts, pair.source):
            pair = replace(pair, start=state.edited)
    missed = apply(item, pair)
    _remember(item, pair.start, colors.edited(item))
    return missed


def source_picked(item: bpy.types.PropertyGroup) -> None:
    """Remember the swatches with which the picture shows the source that was just picked, and how it is exposed.

    A target that was applied is held from now on, so that paint after paint can be changed.
    """
    before, after, now = colors.stored(item, "before"), colors.stored(item, "after"), colors.edited(item)
    if (before != after).any() and (after == now).all():
        given = [*colors.held(item), np.array(item.target)][-MOST_HELD:]
        item.held = " ".join(map(rgb_to_hex, given))
    item.gains = displayed.of(item.id_data).gains
    _remember(item, now, now)


def _remember(item: bpy.types.PropertyGroup, before: np.ndarray, after: np.ndarray) -> None:
    item.swatches.foreach_set("before", before.ravel())
    item.swatches.foreach_set("after", after.ravel())
