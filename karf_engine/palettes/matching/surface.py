"""Change the saturation, brightness and gloss of a paint by means of its palette.

Each color of the object gets a target, and the palette is fitted to the targets (`fitting`), so the change carries over
to every view.

Arguments as in `becomes`. "light" is linear, with the luminance Y of its sRGB primaries.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from ...io.arguments import check_fields, check_number
from ...io.color import linear_to_srgb, srgb_to_linear
from ..color_histogram import weighted_quantile
from .fitting import match_pixels
from .paints import pigment_gate, separate_dichromatic, smooth_step

MAX_FACTOR = 4.0  # highest saturation and gloss
MAX_BRIGHTNESS = 2.0
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear sRGB, Rec. 709
LIT = 0.98  # quantile of the shading of lit parts
CLIPPED = 0.9  # least sRGB value of a highlight that may be clipped in the photo
FAINT = 1e-4  # luminance times count of an invisible paint
GLOSS_COST = 0.1  # penalty of gloss beside paint
HOLD = 3.0  # extra weight of the colors of other paints


@dataclass(frozen=True)
class Surface:
    """Surface of a paint; the neutral default changes nothing. Raises BadRequest if a value is out of range."""

    saturation: float = 1.0  # factor of the distance to the gray of the same luminance, 0 to 4; 0 is gray
    brightness: float = 0.0  # lifts or lowers mid-tones, -2 to 2 f-stops at the dark end; black and white stay
    gloss: float = 1.0  # factor of the highlights, 0 to 4; 0 is matte

    def __post_init__(self) -> None:
        check_fields(self)
        for name in ("saturation", "gloss"):
            check_number(name, getattr(self, name), 0.0, MAX_FACTOR)
        check_number("brightness", self.brightness, -MAX_BRIGHTNESS, MAX_BRIGHTNESS)

    @property
    def is_neutral(self) -> bool:
        return self == Surface()


def match_surface(
    colors: np.ndarray,
    counts: np.ndarray,
    palette_weights: np.ndarray,
    palette: np.ndarray,
    surfaces: Mapping[int, Surface],  # by swatch; several of one paint are applied in order
    locked: Iterable[int] = (),
    moved: np.ndarray | None = None,  # [M, 3], earlier change of each entry by surfaces; locked ones keep it
) -> np.ndarray:
    """Return the palette [M, 3] float32 in [0, MAX_SRGB] that gives the paints of some swatches other surfaces.

    Other paints stay; if all surfaces are neutral, so do the palette's bits.
    """
    targets, reached = colors, np.zeros(len(colors))
    moved = np.zeros_like(palette) if moved is None else moved
    for index in sorted(index for index, surface in surfaces.items() if not surface.is_neutral):
        # highlights of the paint may clip to white
        gate = pigment_gate(colors, np.clip(palette[index], 0, 1))
        gate = np.maximum(gate, smooth_step(colors.min(axis=1), CLIPPED, 1.0))
        targets = surface_target(targets, counts, gate, surfaces[index])
        reached = np.maximum(reached, gate)
    if not reached.any():
        return np.array(palette + moved, np.float32)
    importance = counts * (1 + HOLD * (1 - reached))
    return match_pixels(palette_weights, colors + palette_weights @ moved, targets, palette + moved, importance, locked)


def surface_target(colors: np.ndarray, counts: np.ndarray, gate: np.ndarray, surface: Surface) -> np.ndarray:
    """Return the colors after a paint gets another surface, sRGB [n, 3] float64 in [0, 1].

    Linear light is c = a r + s (1, 1, 1) + rest with paint r, shading a and gloss s (see `paints`); r is the mean of
    the more saturated half. Brightness bends a, gloss scales s, and saturation scales the chroma of the sum. An object
    that does not show the paint keeps its colors. `gate` [n] in [0, 1] is the share of each color that is of the paint.
    """
    light, counts = srgb_to_linear(colors), counts * gate
    weights = counts * (light @ LUMINANCE)
    if weights.sum() <= FAINT:
        return colors
    paint = _paint(light, weights)
    shadings, gloss = separate_dichromatic(light, paint[None], GLOSS_COST)
    shading = shadings[:, 0]
    change = (_bent(shading, 1 / paint.max(), surface.brightness) - shading)[:, None] * paint
    change += (surface.gloss - 1) * _gloss_color(light, paint, shading, gloss, counts)
    result = _saturated(np.maximum(light + change, 0), surface.saturation)
    return np.clip(linear_to_srgb(np.maximum(light + gate[:, None] * (result - light), 0)), 0, 1)


def _paint(light: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return a paint's color [3] at luminance 1: the mean of the more saturated half, which has the least gloss."""
    chromaticity = light / np.maximum(light.sum(axis=1, keepdims=True), 1e-9)
    purity = 1 - 3 * chromaticity.min(axis=1)
    half = purity >= weighted_quantile(purity, weights, 0.5)
    mean = np.average(chromaticity[half], axis=0, weights=weights[half])
    return mean / (mean @ LUMINANCE)


def _saturated(light: np.ndarray, factor: float) -> np.ndarray:
    """Scale the chroma of light [n, 3], within the gamut: a clipped channel would change the luminance."""
    gray = (light @ LUMINANCE)[:, None]
    chroma = light - gray
    limit = np.where(chroma > 0, 1 - gray, gray) / np.maximum(np.abs(chroma), 1e-9)
    return gray + np.minimum(factor, np.maximum(limit.min(axis=1, keepdims=True), 1)) * chroma


def _bent(shading: np.ndarray, white: float, stops: float) -> np.ndarray:
    """Map the shading [n] along a curve through 0 and `white`, with slope 2^stops at 0."""
    steep = 2.0**stops
    return steep * shading / (1 + (steep - 1) * np.minimum(shading / white, 1))


def _gloss_color(
    light: np.ndarray, paint: np.ndarray, shading: np.ndarray, gloss: np.ndarray, counts: np.ndarray
) -> np.ndarray:
    """Return the light [n, 3] that gloss adds: gray, tinted by the residual as the share of gloss grows."""
    # where a photo clips a highlight, the shading is unknown, and the paint counts as lit
    share = gloss / np.maximum(gloss + shading, 1e-9)
    is_clipped = share * smooth_step(light.max(axis=1), float(srgb_to_linear(np.array(CLIPPED))), 1.0)
    lit = np.maximum(shading, weighted_quantile(shading, counts, LIT))
    excess = light - (shading + is_clipped * (lit - shading))[:, None] * paint
    return gloss[:, None] + np.maximum(share, is_clipped)[:, None] * (excess - gloss[:, None])
