"""Step 3: coarse masks, painted over photos."""

import bpy

from ..pictures import masks
from ..project import captures


def paint_mask(scene: bpy.types.Scene, name: str) -> bpy.types.Image:
    """Begin a coarse mask of object `name` on the active view's photo.

    Returns:
        The image to paint on.
    """
    return masks.start(scene, name, captures.view_of(scene))


def save_mask(scene: bpy.types.Scene) -> tuple[str, float]:
    """Write the painted mask.

    Returns:
        Its file, and the painted share of the picture.
    """
    return masks.save(scene, captures.view_of(scene, scene.karf.mask_view))
