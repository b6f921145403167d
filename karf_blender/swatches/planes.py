"""The edit planes of one view or camera, and the picture that they make with a scene's swatches as they stand."""

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path

import bpy
import numpy as np

from ..engine_api import (
    DataError,
    Planes,
    SwatchPicture,
    palette_only,
    photo_plus_change,
    spread_objects,
    stack_palettes,
)
from ..pictures import images
from . import colors
from .object_masks import ObjectMasks


@dataclass(eq=False)
class ShownView:
    """Planes of one view, ready for compositing.

    Attributes:
        file: Where they are from.
        written: The file's time, in nanoseconds.
        planes: As stored.
        is_free: A camera's that has no photo: the base is what is learned.
        masks: The objects in them, once they were painted.
        pictures: By compositing, once it was asked for: the picture that follows the swatches, and the RGBA buffer
            [H, W, 4] float32 in Blender's row order that it writes to.
        with_sets: By added colors, those asked for last: the view whose weights are spread over their sets.
        canvas: Where a picture that is not just the edited one is put together, RGBA as above; None before the first.
        split_at: The canvas has the original left of this column.
    """

    file: Path
    written: int
    planes: Planes
    is_free: bool = False
    masks: ObjectMasks | None = None
    pictures: dict[str, tuple[SwatchPicture, np.ndarray]] = field(default_factory=dict)
    with_sets: dict[str, "ShownView"] = field(default_factory=dict)
    canvas: np.ndarray | None = None
    split_at: int = 0

    def recolored(self, scene: bpy.types.Scene) -> np.ndarray:
        """Recolor the view by a scene's swatches; planes of before palettes were learned show their base.

        Returns:
            RGBA buffer [H, W, 4] float32 in Blender's row order (see `images.upright`); overwritten by the next call.

        Raises:
            DataError: The planes belong to other palettes.
        """
        if not self.planes.palette_weights.shape[1]:
            return self._picture("delta")[1]
        view = self.spread(scene)
        objects, items = view.planes.objects, {item.name: item for item in scene.karf.objects}
        factors = stack_palettes(objects, {name: colors.edited(item) for name, item in items.items()})
        compositing = scene.karf.compositing
        if compositing != "paper":
            factors -= stack_palettes(objects, {name: colors.learned(item) for name, item in items.items()})
        picture, buffer = view._picture(compositing)
        picture.paint(factors)
        return buffer

    def spread(self, scene: bpy.types.Scene) -> "ShownView":
        """The view with its weights spread over the sets of the scene's added colors; without such colors itself.

        Raises:
            DataError: The planes belong to other palettes.
        """
        objects, learned = self.planes.objects, {palette.name: palette for palette in colors.palettes(scene)}
        if set(objects) != set(learned):
            raise DataError(
                f"{self.file} was made for the objects {', '.join(objects)}.", "Extract the palettes again."
            )
        if max(len(palette.colors) for palette in learned.values()) != self.planes.palette_weights.shape[1]:
            raise DataError(f"{self.file} was made for other palettes.", "Press Prepare in step 6.")
        added = colors.added_by_object(scene)
        if not added:
            return self
        key = repr([(name, colors.keys(own)) for name, own in added.items()])
        if key not in self.with_sets:
            weights = spread_objects(self.planes.palette_weights, [learned[name] for name in objects], added)
            planes = dataclasses.replace(self.planes, palette_weights=weights)
            self.with_sets.clear()
            self.with_sets[key] = ShownView(self.file, self.written, planes)
        return self.with_sets[key]

    def _picture(self, compositing: str) -> tuple[SwatchPicture, np.ndarray]:
        """The picture of one compositing, and its buffer."""
        if compositing not in self.pictures:
            height, width = self.planes.base.shape[:2]
            buffer = images.blank(width, height)
            follow = palette_only if compositing == "paper" else photo_plus_change
            self.pictures[compositing] = follow(self.planes, images.upright(buffer)), buffer
        return self.pictures[compositing]
