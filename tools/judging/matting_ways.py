"""Ways to mattes of a photo at its own size: ours, and what it is measured against."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.ndimage import distance_transform_edt

from karf_engine.io.color import srgb_to_linear
from karf_engine.recolor.matting.closed_form import closed_form_matting
from karf_engine.recolor.matting.matte import Matte
from karf_engine.recolor.matting.refine import field_mattes, mattes_of

from .edges import distance

GUIDED_RADIUS, GUIDED_EPSILON = 8, 1e-4
NEAR = 8  # pixels, within which a thing keeps its color
KNOWN_BAND = 3  # pixels of the field on either side of its border, which matting alone decides


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
    return mattes_of("field", evidence.photo, evidence.probabilities, evidence.rendered)


def ours(evidence: Evidence) -> list[Matte]:
    """The field says roughly where, the photo exactly where."""
    return mattes_of("photo", evidence.photo, evidence.probabilities, evidence.rendered)


def bicubic(evidence: Evidence) -> list[Matte]:
    """The field's probabilities, enlarged with cubic splines."""
    height, width = evidence.photo.shape[:2]
    return as_mattes(enlarged(evidence.probabilities, width, height, cv2.INTER_CUBIC).clip(0, 1))


def guided(evidence: Evidence) -> list[Matte]:
    """The enlarged probabilities through a guided filter with the photo's colors (He et al. 2013, eq. 19 to 21)."""
    height, width = evidence.photo.shape[:2]
    guide = evidence.photo.astype(np.float32) / 255
    mean = blurred(guide)
    products = blurred((guide[..., :, None] * guide[..., None, :]).reshape(height, width, 9))
    covariance = products.reshape(height, width, 3, 3) - mean[..., :, None] * mean[..., None, :]
    covariance += GUIDED_EPSILON * np.eye(3, dtype=np.float32)
    planes = []
    for plane in enlarged(evidence.probabilities, width, height, cv2.INTER_LINEAR):
        level = blurred(plane)
        joint = blurred(guide * plane[..., None]) - mean * level[..., None]
        slope = np.linalg.solve(covariance, joint[..., None])[..., 0]
        offset = level - (slope * mean).sum(-1)
        planes.append((blurred(slope) * guide).sum(-1) + blurred(offset))
    return as_mattes(np.clip(planes, 0, 1))


def matting_alone(evidence: Evidence) -> list[Matte]:
    """Closed-form matting (Levin et al. 2008) of a band about the field's border, of each object by itself."""
    height, width = evidence.photo.shape[:2]
    band = KNOWN_BAND * width / evidence.probabilities.shape[2]
    light = srgb_to_linear(evidence.photo / np.float32(255))
    planes = []
    for plane in enlarged(evidence.probabilities, width, height, cv2.INTER_LINEAR):
        mask = plane > 0.5
        unknown = (distance(mask) <= band) & (distance(~mask) <= band)
        result = mask.astype(np.float32)
        result[unknown] = closed_form_matting(light, np.where(unknown, plane, result), unknown)
        planes.append(result)
    return as_mattes(np.stack(planes))


def larger_field(evidence: Evidence) -> list[Matte]:
    """The probabilities of a field that was learned from larger photos."""
    return field_mattes(evidence.photo.shape[1::-1], evidence.larger)


def true_coverage(evidence: Evidence) -> list[Matte]:
    """The truth: what no matte can beat."""
    return [with_own_colors(matte, evidence.photo) for matte in as_mattes(evidence.coverage)]


WAYS: dict[str, Callable[[Evidence], list[Matte]]] = {
    "field": enlarged_field,
    "bicubic": bicubic,
    "guided": guided,
    "matting": matting_alone,
    "photo": ours,
    "truth": true_coverage,
}


def as_mattes(planes: np.ndarray) -> list[Matte]:
    """Coverages [K, H, W] as mattes that know no colors but the photo's."""
    return field_mattes((planes.shape[2], planes.shape[1]), planes.astype(np.float32))


def with_own_colors(matte: Matte, photo: np.ndarray) -> Matte:
    """The matte with the color of the nearest pixel that the object fills, wherever it does not fill the pixel."""
    colors = photo[slice(*matte.rows), slice(*matte.columns)]
    full, mixed = matte.coverage == 1, (matte.coverage > 0) & (matte.coverage < 1)
    away, nearest = distance_transform_edt(~full, return_indices=True)
    mixed &= away < NEAR
    return replace(matte, mixed=np.flatnonzero(mixed), mixed_colors=colors[tuple(nearest)][mixed])


def enlarged(planes: np.ndarray, width: int, height: int, interpolation: int) -> np.ndarray:
    """Planes [K, h, w] at another size."""
    return np.stack([cv2.resize(plane, (width, height), interpolation=interpolation) for plane in planes])


def blurred(image: np.ndarray) -> np.ndarray:
    """Means over squares of `GUIDED_RADIUS`."""
    side = 2 * GUIDED_RADIUS + 1
    if image.ndim == 2 or image.shape[2] <= 4:
        return cv2.blur(image, (side, side))
    return np.stack([cv2.blur(channel, (side, side)) for channel in np.moveaxis(image, -1, 0)], -1)
