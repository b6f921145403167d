"""Step 6: swatches that move together. A swatch is an object's name and a number from 1: swatch 0 is black."""

import bpy
import numpy as np

from ..engine_api import BadRequest, srgb_to_lab
from ..swatches import colors, edits, groups, recolor

Swatch = tuple[str, int]


def link_swatches(scene: bpy.types.Scene, one: Swatch, other: Swatch) -> None:
    """Give one swatch the other's color, and let both, and what each was linked to, have one color from now on.

    Raises:
        BadRequest: There is no such swatch, or the first is locked.
    """
    first, second = edits.unlocked(scene, *one), edits.swatch_at(scene, *other)
    if first == second or second.merged:
        raise BadRequest(f"Swatch {one[1]} of {one[0]!r} cannot be linked with that.", "Choose another swatch.")
    with recolor.batched(scene):
        groups.link(first, second)


def unlink_swatch(scene: bpy.types.Scene, name: str, index: int) -> None:
    """Let a swatch move by itself again; its color stays."""
    groups.unlink(edits.swatch_at(scene, name, index))


def merge_swatch(scene: bpy.types.Scene, name: str, index: int, into: int | None = None) -> int:
    """Let one swatch of an object move another's paint along with its own: both then change by the same amount.

    Args:
        scene: The scene.
        name: The object's.
        index: The swatch that is no longer shown.
        into: The one that moves it; None: the one whose learned color is nearest.

    Returns:
        The number of the swatch that moves it.

    Raises:
        BadRequest: There is no such swatch, it is locked, or no other is shown.
    """
    edits.unlocked(scene, name, index)
    item = edits.object_named(scene, name)
    others = [each for each in range(1, len(item.swatches)) if each != index and not item.swatches[each].merged]
    if not others or into not in (None, *others):
        raise BadRequest(
            f"Swatch {index} of {name!r} cannot be merged into {into or 'another'}.",
            "Choose another swatch of this object that is shown.",
        )
    if into is None:
        lab = srgb_to_lab(colors.learned(item))
        into = min(others, key=lambda other: float(np.linalg.norm(lab[other] - lab[index])))
    with recolor.batched(scene):
        groups.merge(item, index, into)
    return into


def split_swatch(scene: bpy.types.Scene, name: str, index: int) -> None:
    """Show the swatches again that were merged into one; each moves by itself, colors stay."""
    edits.swatch_at(scene, name, index)
    groups.split(edits.object_named(scene, name), index)
