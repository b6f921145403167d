"""The rays that end on objects: what palettes and F_w are learned from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from torch import Tensor

MIN_INTERIOR_PIXELS = 50  # of an object in all views together: fewer do not make a palette
UNSEEN = np.full((1, 3), 0.5, np.float32)  # the one color of an object that nothing shows
BACKGROUND = 255  # in the place of an object's number


@dataclass(frozen=True)
class ObjectSurface:
    """Surface samples of the n rays that end on an object in the cached views, S samples each.

    Attributes:
        positions: [n, S, 3] float32, grid coordinates.
        viewdirs: [n, 3] float32, unit length.
        colors: [n, 3] uint8 sRGB of the photo.
        object: [n] uint8 from 0, into the objects' names.
        interior: [n] bool, well inside the object.
        view: [n] int16, into the names of the cached views.
    """

    positions: Tensor
    viewdirs: Tensor
    colors: Tensor
    object: Tensor
    interior: Tensor
    view: Tensor


def object_pixels(surface: ObjectSurface, objects: list[str]) -> list[list[np.ndarray]]:
    """Photo colors well inside each object: for each object one array [n, 3] float32 sRGB in [0, 1] a view.

    Of an object with too few pixels to make a palette of (`scarce_objects`) it is their mean; where it has none, gray.

    Args:
        surface: rays of these objects.
        objects: their names.
    """
    colors = surface.colors.cpu().numpy().astype(np.float32) / 255
    owner, view, interior = (values.cpu().numpy() for values in (surface.object, surface.view, surface.interior))
    scarce, pixels = scarce_objects(surface, objects), []
    for k, name in enumerate(objects):
        chosen = (owner == k) & interior
        if name in scarce:
            pixels.append([colors[chosen].mean(0, keepdims=True) if chosen.any() else UNSEEN])
        else:
            pixels.append([colors[chosen & (view == v)] for v in np.unique(view[chosen])])
    return pixels


def scarce_objects(surface: ObjectSurface, objects: list[str]) -> dict[str, int]:
    """How many pixels objects show that show too few to make a palette of, by their names; arguments as above."""
    shown = np.bincount(surface.object[surface.interior].cpu().numpy(), minlength=len(objects)).tolist()
    return {name: count for name, count in zip(objects, shown, strict=True) if count < MIN_INTERIOR_PIXELS}
