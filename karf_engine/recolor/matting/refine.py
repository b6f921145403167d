"""Mattes of a photo's objects, from the field's probabilities alone or refined in the photo."""

from __future__ import annotations

import numpy as np

from ...io.images import resize
from .marks import Marks
from .matte import NEGLIGIBLE, Matte, cropped
from .photo_mattes import refine_mattes


def make_mattes(
    edges: str,
    photo: np.ndarray,
    probabilities: np.ndarray,
    rendered: np.ndarray,
    marks: Marks | None = None,
    seed: int = 0,
) -> list[Matte]:
    """Make mattes of the K objects of a photo.

    Args:
        edges: `photo`: refined in the photo; `field`: the probabilities alone.
        photo: uint8 sRGB [H, W, 3].
        probabilities: [K, h, w] of each object, in the grid of the photo at any size.
        rendered: uint8 sRGB [h, w, 3], the field's rendering.
        marks: Rough masks of the photo, in its grid.
        seed: For the pixels that color models are fitted to.

    Example:
        >>> mattes = make_mattes("field", np.zeros((2, 4, 3), np.uint8), np.array([[[0.0, 1.0]]]), np.zeros((1, 2, 3)))
        >>> mattes[0].columns, mattes[0].coverage.tolist()
        ((1, 4), [[0.25, 0.75, 1.0], [0.25, 0.75, 1.0]])
    """
    if edges == "field" or not len(probabilities):
        return field_mattes((photo.shape[1], photo.shape[0]), probabilities)
    return refine_mattes(photo, probabilities, rendered, marks, seed)


def field_mattes(size: tuple[int, int], probabilities: np.ndarray) -> list[Matte]:
    """Enlarge probabilities [K, h, w] to mattes of a photo of this width and height."""
    return [_field_matte(size, own) for own in probabilities]


def _field_matte(size: tuple[int, int], probability: np.ndarray) -> Matte:
    coverage = resize(probability, *size)
    dtype = np.float32 if probability.shape == coverage.shape else np.float16  # interpolated values need less precision
    return cropped(np.where(coverage > NEGLIGIBLE, coverage, 0), dtype)
