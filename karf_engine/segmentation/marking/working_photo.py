"""A photo at the working size of marking, with the links between its pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...io.color import srgb_to_lab, to_bytes
from ...io.images import alpha_composite, resize
from ..random_walk import Link, neighbor_links

LONG_SIDE = 256  # pixels; a click takes a fifth of a second
LIKENESS = 0.1  # per squared Lab unit; tuned together with `regions`


@dataclass(frozen=True)
class WorkingPhoto:
    """A photo of [h, w] pixels at the working size.

    Attributes:
        colors: [h, w, 3] uint8 sRGB.
        links: between neighbors, see `random_walk.neighbor_links`.
        scale: (x, y), working pixels per pixel of the photo.
    """

    colors: np.ndarray
    links: tuple[Link, ...]
    scale: tuple[float, float]

    @property
    def shape(self) -> tuple[int, int]:
        """(h, w)."""
        height, width, _ = self.colors.shape
        return height, width

    def disk(self, x: float, y: float, radius: int) -> np.ndarray:
        """Return a disk around a point of the stored photo, bool [h, w]."""
        column, row = self.pixel(x, y)
        rows, columns = np.ogrid[: self.shape[0], : self.shape[1]]
        return (rows - row) ** 2 + (columns - column) ** 2 <= radius**2

    def pixel(self, x: float, y: float) -> tuple[int, int]:
        """Return column and row of the pixel at a point of the stored photo."""
        return int(x * self.scale[0]), int(y * self.scale[1])


def working_photo(photo: np.ndarray) -> WorkingPhoto:
    """Reduce a photo to the working size; small ones keep theirs. photo: float sRGB [H, W, 3 or 4], straight alpha."""
    height, width = photo.shape[:2]
    factor = min(1.0, LONG_SIDE / max(height, width))
    size = max(1, round(width * factor)), max(1, round(height * factor))
    alpha = resize(photo[..., 3], *size) if photo.shape[-1] == 4 else None
    colors = alpha_composite(resize(photo[..., :3], *size), alpha)
    links = tuple(neighbor_links(srgb_to_lab(colors).astype(np.float32), LIKENESS))
    return WorkingPhoto(to_bytes(colors), links, (size[0] / width, size[1] / height))
