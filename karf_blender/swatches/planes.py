"""The edit planes of the view that is shown, and the picture that they make with the swatches as they stand.

Planes come from the project folder; only those of the view shown last are kept in memory.
"""

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
    read_planes,
    spread_objects,
    stack_palettes,
)
from ..pictures import images
from ..project import contents
from . import colors, pigments


@dataclass(frozen=True)
class ShownView:
    """Planes of one view, ready for compositing.

    Attributes:
        file: Where they are from.
        written: The file's time, in nanoseconds.
        planes: As stored.
        is_free: A camera's that has no photo: the base is what is learned.
        pictures: By compositing, once it was asked for: the picture that follows the swatches, and the RGBA buffer
            [H, W, 4] float32 in Blender's row order that it writes to.
        with_sets: By added colors, those asked for last: the view whose weights are spread over their sets.
    """

    file: Path
    written: int
    planes: Planes
    is_free: bool = False
    pictures: dict[str, tuple[SwatchPicture, np.ndarray]] = field(default_factory=dict)
    with_sets: dict[str, "ShownView"] = field(default_factory=dict)

    def picture(self, compositing: str) -> tuple[SwatchPicture, np.ndarray]:
        """The picture of one compositing, and its buffer."""
        if compositing not in self.pictures:
            height, width = self.planes.base.shape[:2]
            buffer = images.blank(width, height)
            follow = palette_only if compositing == "paper" else photo_plus_change
            self.pictures[compositing] = follow(self.planes, images.upright(buffer)), buffer
        return self.pictures[compositing]


class _Memory:
    """The planes shown last."""

    view: ShownView | None = None


def shown_view(scene: bpy.types.Scene) -> ShownView:
    """The planes of the active view, read from disk where they are not the ones in memory.

    Raises:
        KarfError: There are none, or they are older than the palettes.
    """
    file = contents.planes_file(scene)
    if not contents.is_prepared(scene):
        raise DataError(
            f"{file} (edit planes) is older than the palettes."
            if file.exists()
            else f"{file} (edit planes) does not exist.",
            "Press Prepare in step 6.",
        )
    return load(file)


def load(file: Path) -> ShownView:
    """The planes of a file, of any camera, read where they are not the ones in memory.

    Raises:
        DataError: The file is missing or damaged.
    """
    written = file.stat().st_mtime_ns if file.exists() else 0
    known = _Memory.view
    if known is None or (known.file, known.written) != (file, written):
        _Memory.view = ShownView(file, written, read_planes(file))
    return _Memory.view


def forget() -> None:
    """Drop the planes in memory."""
    _Memory.view = None


def composite(scene: bpy.types.Scene) -> np.ndarray:
    """Recolor the active view by the swatches.

    Returns:
        RGBA buffer [H, W, 4] float32 in Blender's row order (see `images.upright`); overwritten by the next call.

    Raises:
        KarfError: The view has no planes, or they belong to other palettes.
    """
    return recolored(shown_view(scene), scene)


def spread(view: ShownView, scene: bpy.types.Scene) -> ShownView:
    """A view with its weights spread over the sets of the scene's added colors; without such colors the view itself.

    Raises:
        DataError: The planes belong to other palettes.
    """
    objects, learned = view.planes.objects, {palette.name: palette for palette in pigments.palettes(scene)}
    if set(objects) != set(learned):
        raise DataError(f"{view.file} was made for the objects {', '.join(objects)}.", "Extract the palettes again.")
    if max(len(palette.colors) for palette in learned.values()) != view.planes.palette_weights.shape[1]:
        raise DataError(f"{view.file} was made for other palettes.", "Press Prepare in step 6.")
    added = pigments.of(scene)
    if not added:
        return view
    key = repr([(name, pigments.keys(own)) for name, own in added.items()])
    if key not in view.with_sets:
        weights = spread_objects(view.planes.palette_weights, [learned[name] for name in objects], added)
        planes = dataclasses.replace(view.planes, palette_weights=weights)
        view.with_sets.clear()
        view.with_sets[key] = ShownView(view.file, view.written, planes)
    return view.with_sets[key]


def recolored(view: ShownView, scene: bpy.types.Scene) -> np.ndarray:
    """The picture that planes of any view or camera make with the scene's swatches, as `composite` returns it.

    Planes of before palettes were learned show their base.

    Raises:
        DataError: The planes belong to other palettes.
    """
    if not view.planes.palette_weights.shape[1]:
        return view.picture("delta")[1]
    view = spread(view, scene)
    objects, items = view.planes.objects, {item.name: item for item in scene.karf.objects}
    factors = stack_palettes(objects, {name: colors.edited(item) for name, item in items.items()})
    compositing = scene.karf.compositing
    if compositing != "paper":
        factors -= stack_palettes(objects, {name: colors.learned(item) for name, item in items.items()})
    picture, buffer = view.picture(compositing)
    picture.paint(factors)
    return buffer
