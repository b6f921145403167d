"""Fit swatches to a painted or graded view: a robust, bounded fit to the picture's pixels.

Shapes as in `compositing`: K objects, M palette entries, H x W pixels; n pixels of one object.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...errors import BadRequest
from ...io.color import ciede2000, srgb_to_lab
from ..compositing import hard_masks
from ..palette import MAX_SRGB, Palette
from .fitting import apply_change, bounded_least_squares, bounds

PAINTED = 4 / 255  # difference in one channel of a painted pixel; less can be rounding or noise
MIN_PAINTED = 0.002  # least share of painted pixels of a fitted object
UNPAINTED = 0.1  # total weight of the unpainted pixels of an object, relative to the painted ones
OUTLIER = 0.1  # sRGB residual that quarters a pixel's weight
SPILL = 0.4  # least strength, relative to the strongest object, of a match that worsens its object as a whole
RIDGE = 1e-3  # per unit of counts; keeps rarely used swatches in place
ROUNDS = 10  # of reweighting
MAX_PIXELS = 20_000  # sampled pixels of an object


@dataclass(frozen=True)
class ObjectMatch:
    """Result of the fit for one object."""

    name: str
    colors: np.ndarray  # fitted palette, [M, 3] float32 in [0, MAX_SRGB]
    before: float  # mean CIEDE2000 of its pixels to the wanted picture before the fit
    after: float
    painted: float  # share of painted pixels, 0 to 1

    @property
    def strength(self) -> float:
        """Mean CIEDE2000 of the painted pixels before the fit."""
        return self.before / self.painted


def match_picture(
    palette_weights: np.ndarray,
    probabilities: np.ndarray,
    base: np.ndarray,  # the unedited view, [H, W, 3] in [0, 1]
    wanted: np.ndarray,  # the painted view, in the same shape
    palettes: Sequence[Palette],  # as learned, of the K objects
    edited: Mapping[str, np.ndarray],  # current palettes by object
    locked: Mapping[str, Iterable[int]] | None = None,  # swatches that stay, by object
) -> tuple[ObjectMatch, ...]:
    """Fit the palettes to a painted picture of a view; return one match for each visible painted object.

    Only differences between the picture and the edited view count. Objects that only reflect the new colors of others,
    faintly and in parts, stay. Raises BadRequest if the picture has another size than the view.
    """
    if wanted.shape != base.shape:
        raise BadRequest(
            f"The picture has {wanted.shape[1]} x {wanted.shape[0]} pixels, "
            f"the view {base.shape[1]} x {base.shape[0]}.",
            "Take a picture of this view.",
        )
    matches = []
    for k, mask in enumerate(hard_masks(np.asarray(probabilities, np.float32))):
        palette, pixels = palettes[k], np.flatnonzero(mask)
        pixels = pixels[np.linspace(0, len(pixels) - 1, min(len(pixels), MAX_PIXELS)).astype(np.intp)]
        shown = base.reshape(-1, 3)[pixels].astype(np.float64)
        for other, planes in zip(palettes, palette_weights, strict=True):
            change = edited[other.name] - other.colors
            if change.any():
                shown += _weights_at(planes, pixels, len(change)) @ change
        aim = wanted.reshape(-1, 3)[pixels].astype(np.float64)
        painted = np.any(np.abs(aim - np.clip(shown, 0, 1)) > PAINTED, axis=1)
        if painted.sum() > MIN_PAINTED * len(pixels):
            weights = _weights_at(palette_weights[k], pixels, len(palette.colors))
            stays = (locked or {}).get(palette.name, ())
            colors = _fit(weights, shown, aim, painted, edited[palette.name], stays)
            reached = shown + weights @ (colors - edited[palette.name])
            before, after = _difference(shown, aim), _difference(reached, aim)
            matches.append(ObjectMatch(palette.name, colors, before, after, float(painted.mean())))
    strongest = max((match.strength for match in matches), default=0.0)
    return tuple(match for match in matches if match.after < match.before or match.strength >= SPILL * strongest)


def _weights_at(planes: np.ndarray, pixels: np.ndarray, size: int) -> np.ndarray:
    """Return the weights [n, size] from an object's planes [M, H, W], which may be padded."""
    return planes.reshape(len(planes), -1)[:size, pixels].T.astype(np.float64)


def _difference(picture: np.ndarray, aim: np.ndarray) -> float:
    return float(ciede2000(srgb_to_lab(np.clip(picture, 0, 1)), srgb_to_lab(aim)).mean())


def _fit(
    weights: np.ndarray,
    shown: np.ndarray,
    aim: np.ndarray,
    painted: np.ndarray,
    palette: np.ndarray,
    locked: Iterable[int],
) -> np.ndarray:
    """Return the palette [M, 3] that moves pixels from `shown` to `aim`, [n, 3], by reweighted least squares."""
    # weights of Geman and McClure (1987), "Statistical methods for tomographic image reconstruction", suppress what no
    # palette can explain, such as a stray brush stroke
    lower, upper = bounds(palette, locked, MAX_SRGB)
    counts = np.where(painted, 1.0, UNPAINTED * painted.sum() / max(1, (~painted).sum()))
    unclipped = painted & (aim > 0).all(axis=1) & (aim < 1).all(axis=1)
    confidence, reached = (unclipped if unclipped.any() else painted).astype(np.float64), shown
    for _ in range(ROUNDS):
        # colors beyond white or black meet a clipped target
        is_clipped = (aim >= 1) & (reached > 1) | (aim <= 0) & (reached < 0)
        wanted = np.where(is_clipped, reached, aim)
        change = bounded_least_squares(weights, wanted - shown, lower, upper, counts * confidence, RIDGE)
        reached = shown + weights @ change
        residual = np.linalg.norm(np.clip(reached, 0, 1) - aim, axis=1)
        confidence = 1 / (1 + (residual / OUTLIER) ** 2) ** 2
    return apply_change(palette, change)
