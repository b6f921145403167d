"""The edit planes of the view that is shown, and the picture that they make with the swatches as they stand.

Planes come from the project folder; only those of the view shown last are kept in memory.
"""

from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from ..engine_api import DataError, delta_composite, paper_composite, read_planes, stack_palettes
from ..pictures import images
from ..project import contents
from . import colors


@dataclass(frozen=True)
class ShownView:
    """Planes of one view, ready for compositing.

    Attributes:
        file: Where they are from.
        written: The file's time, in nanoseconds.
        objects: Names of the K objects.
        palette_weights: [K, M, H, W] float32.
        probabilities: [K, H, W] float32.
        base: [H, W, 3] float32, sRGB in [0, 1].
        buffer: [H, W, 4] float32 in Blender's row order, overwritten by every picture.
    """

    file: Path
    written: int
    objects: tuple[str, ...]
    palette_weights: np.ndarray
    probabilities: np.ndarray
    base: np.ndarray
    buffer: np.ndarray


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
        what = "is older than the palettes" if file.exists() else "does not exist"
        raise DataError(f"{file} (edit planes) {what}.", "Press Prepare in step 6.")
    return load(file)


def load(file: Path) -> ShownView:
    """The planes of a file, of any camera, read where they are not the ones in memory.

    Raises:
        DataError: The file is missing or damaged.
    """
    written = file.stat().st_mtime_ns if file.exists() else 0
    known = _Memory.view
    if known is None or (known.file, known.written) != (file, written):
        planes = read_planes(file)
        height, width = planes.base.shape[:2]
        _Memory.view = ShownView(
            file=file,
            written=written,
            objects=planes.objects,
            palette_weights=planes.palette_weights.astype(np.float32),
            probabilities=planes.probabilities.astype(np.float32),
            base=planes.base.astype(np.float32) / np.float32(255),
            buffer=images.blank(width, height),
        )
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


def recolored(view: ShownView, scene: bpy.types.Scene) -> np.ndarray:
    """The picture that planes of any view or camera make with the scene's swatches, as `composite` returns it.

    Raises:
        DataError: The planes belong to other palettes.
    """
    items = {item.name: item for item in scene.karf.objects}
    if set(view.objects) != set(items):
        raise DataError(
            f"{view.file} was made for the objects {', '.join(view.objects)}.", "Extract the palettes again."
        )
    learned = stack_palettes(view.objects, {name: colors.learned(item) for name, item in items.items()})
    edited = stack_palettes(view.objects, {name: colors.edited(item) for name, item in items.items()})
    if learned.shape[1] != view.palette_weights.shape[1]:
        raise DataError(f"{view.file} was made for other palettes.", "Press Prepare in step 6.")
    picture = images.upright(view.buffer)
    if scene.karf.compositing == "paper":
        picture[:] = paper_composite(view.base, view.palette_weights, view.probabilities, edited)
    else:
        delta_composite(view.base, view.palette_weights, learned, edited, out=picture)
    return view.buffer
