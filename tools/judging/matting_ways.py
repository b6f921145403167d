"""Ways to mattes of a photo at its own size: ours, and what it is measured against."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import distance_transform_edt

from karf_engine.recolor.matting.matte import Matte
from karf_engine.recolor.matting.photo_mattes import field_mattes, make_mattes

NEAR = 8  # pixels, within which a thing keeps its color


@dataclass(frozen=True)
class Evidence:
    """What ways to mattes know of a view with K objects.

    Attributes:
        photo: uint8 [H, W, 3] sRGB.
        probabilities: [K, h, w] float32, of the field.
        rendered: uint8 [h, w, 3] sRGB, the scene as the field shows it.
        larger: Probabilities of a field that was learned from larger photos, or None.
        coverage: [K, H, W] float32, the truth.
    """

    photo: np.ndarray
    probabilities: np.ndarray
    rendered: np.ndarray
    larger: np.ndarray | None
    coverage: np.ndarray


def enlarged_field(evidence: Evidence) -> list[Matte]:
    """The field's probabilities, enlarged."""
    return make_mattes("field", evidence.photo, evidence.probabilities, evidence.rendered)


def ours(evidence: Evidence) -> list[Matte]:
    """The field says roughly where, the photo exactly where."""
    return make_mattes("photo", evidence.photo, evidence.probabilities, evidence.rendered)


def larger_field(evidence: Evidence) -> list[Matte]:
    """The probabilities of a field that was learned from larger photos."""
    return field_mattes(evidence.photo.shape[1::-1], evidence.larger)


def true_coverage(evidence: Evidence) -> list[Matte]:
    """The truth: what no matte can beat."""
    size = evidence.coverage.shape[:0:-1]
    return [with_own_colors(matte, evidence.photo) for matte in field_mattes(size, evidence.coverage)]


WAYS: dict[str, Callable[[Evidence], list[Matte]]] = {
    "field": enlarged_field,
    "photo": ours,
    "truth": true_coverage,
}


def with_own_colors(matte: Matte, photo: np.ndarray) -> Matte:
    """The matte with the color of the nearest pixel that the object fills, wherever it does not fill the pixel."""
    colors = photo[slice(*matte.rows), slice(*matte.columns)]
    full, mixed = matte.coverage == 1, (matte.coverage > 0) & (matte.coverage < 1)
    away, nearest = distance_transform_edt(~full, return_indices=True)
    mixed &= away < NEAR
    return replace(matte, mixed=np.flatnonzero(mixed), mixed_colors=colors[tuple(nearest)][mixed])
