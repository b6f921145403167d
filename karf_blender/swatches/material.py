"""Dragging one swatch moves its paint: the object's other swatches follow, as those of a real surface would."""

from collections.abc import Sequence

import bpy
import numpy as np

from .. import session
from ..engine_api import KarfError, Palette, match_dragged, shown_colors
from ..host import rendering
from . import colors, groups, keyframes, shown


def follow(swatch: bpy.types.PropertyGroup, before: Sequence[float]) -> None:
    """Let the paint of a swatch that was dragged follow it, and that of those linked to it; locked swatches stay.

    What programs set stands as it is (`shown.batched`), and so do added colors, which have a pigment of their own.

    Args:
        swatch: With its new color.
        before: The color that it had, [3].
    """
    scene = swatch.id_data
    if not scene.karf.material or shown.is_batched():
        return
    for each in groups.together(swatch):
        if not (each.merged or each.is_added):
            _follow(*groups.place_of(each), before)


def is_dragged(item: bpy.types.PropertyGroup, index: int) -> bool:
    """Whether a swatch of an object was dragged last, and no other has changed since but those that followed it."""
    others = np.arange(len(item.swatches)) != index
    return item.dragged == index and (colors.chosen(item)[others] == colors.stored(item, "given")[others]).all()


def follow_again(item: bpy.types.PropertyGroup) -> None:
    """Solve an object's last drag anew, where nothing has changed since, as after it was said to be of metal."""
    if item.dragged < len(item.swatches) and is_dragged(item, item.dragged) and item.id_data.karf.material:
        _follow(item, item.dragged, item.swatches[item.dragged].last)
        shown.of(item.id_data).refresh()


def before_drag(item: bpy.types.PropertyGroup, index: int) -> np.ndarray:
    """An object's palette [M, 3] without a swatch's edit: as it was before the drag where what followed is known, else
    with the learned color of that swatch."""
    if is_dragged(item, index):
        return colors.stored(item, "began")
    palette = colors.chosen(item)
    palette[index] = colors.learned(item)[index]
    return palette


def _follow(item: bpy.types.PropertyGroup, index: int, before: Sequence[float]) -> None:
    start, locked = _start(item, index, before), groups.held(item)
    now = colors.chosen(item)
    try:
        seen = shown.of(item.id_data).histogram(item)
    except (KarfError, OSError):  # nobody has counted the object's colors: the swatch moves alone
        return
    visible = shown_colors(seen, Palette(item.name, colors.learned(item)), start)
    weights = groups.gathered(item, seen.palette_weights.T).T
    found = match_dragged(visible, seen.counts, weights, start, index, now[index], locked, item.is_metal)
    with groups.apart():
        for number, color in enumerate(found):
            if number != index and number not in locked and (color != now[number]).any():
                item.swatches[number].color = color
    groups.carry_merged(item)
    item.swatches.foreach_set("given", colors.chosen(item).ravel())


def _start(item: bpy.types.PropertyGroup, index: int, before: Sequence[float]) -> np.ndarray:
    """The palette [M, 3] when the drag of a swatch began. It goes on for as long as nothing else has changed."""
    if is_dragged(item, index):
        return colors.stored(item, "began")
    now = colors.chosen(item)
    now[index] = before
    item.dragged = index
    item.swatches.foreach_set("began", now.ravel())
    return now


@session.handler("frame_change_post", phase=session.Phase.SOLVE)
def _after_frame(scene, *_):
    """Keyframes move one swatch without its update; the paint of the one that was dragged last follows here."""
    if not scene.karf.material or rendering.is_running():
        return
    items = {item.name: item for item in scene.karf.objects}
    for curve in keyframes.of(scene):
        item = items.get(curve.object_name)
        if item and isinstance(curve.swatch, int) and curve.tail == ".color" and is_dragged(item, curve.swatch):
            _follow(item, curve.swatch, item.swatches[curve.swatch].last)
