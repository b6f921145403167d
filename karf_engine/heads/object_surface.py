"""The rays that end on objects: training data of palettes and F_w."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from torch import Tensor

MIN_INTERIOR_PIXELS = 50  # of an object in all views, for a palette
UNSEEN = np.full((1, 3), 0.5, np.float32)  # color of an object without pixels
BACKGROUND = 255  # object number of rays without an object


@dataclass(frozen=True)
class ObjectSurface:
    """n rays of the cached views that end on an object, with S surface samples each.

    Attributes:
        positions: [n, S, 3] float32, grid coordinates.
        viewdirs: [n, 3] float32, unit length.
        colors: [n, 3] uint8 sRGB of the photo.
        object: [n] uint8, index of the object.
        interior: [n] bool, well inside the object.
        view: [n] int16, index of the cached view.
    """

    positions: Tensor
    viewdirs: Tensor
    colors: Tensor
    object: Tensor
    interior: Tensor
    view: Tensor


def object_pixels(surface: ObjectSurface, objects: list[str]) -> list[list[np.ndarray]]:
    """Return the interior photo colors of each object, one array [n, 3] float32 sRGB in [0, 1] per view.

    An object with too few pixels for a palette (`objects_with_few_pixels`) has their mean only, or gray without pixels.
    """
    colors = surface.colors.cpu().numpy().astype(np.float32) / 255
    owner, view, interior = (values.cpu().numpy() for values in (surface.object, surface.view, surface.interior))
    scarce, pixels = objects_with_few_pixels(surface, objects), []
    for k, name in enumerate(objects):
        chosen = (owner == k) & interior
        if name in scarce:
            pixels.append([colors[chosen].mean(0, keepdims=True) if chosen.any() else UNSEEN])
        else:
            pixels.append([colors[chosen & (view == v)] for v in np.unique(view[chosen])])
    return pixels


def objects_with_few_pixels(surface: ObjectSurface, objects: list[str]) -> dict[str, int]:
    """Return the number of interior pixels of each object that has too few for a palette, by name."""
    counts = np.bincount(surface.object[surface.interior].cpu().numpy(), minlength=len(objects)).tolist()
    return {name: count for name, count in zip(objects, counts, strict=True) if count < MIN_INTERIOR_PIXELS}
