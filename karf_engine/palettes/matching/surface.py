"""How a paint looks beside its color: saturation, brightness and gloss, brought into a palette.

A picture is linear in an object's palette, so these controls are no filters of pictures: each color of the object gets
the color that it shall have, and the palette is fitted to that (`fitting`). Whatever carries palettes carries them.
Contrast is not among them: shade is mostly a share of the palette's black, which is frozen, so no palette can bring
light and shade closer (docs/limits.md).

Naming: n colors of an object (histogram cells or pixels), [n, 3] sRGB in [0, 1], with counts [n]. palette_weights
[n, M]: each color's share of the M palette entries. Light is linear; luminance Y is that of its sRGB primaries.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from ...io.arguments import check_fields, check_number
from ...io.color import linear_to_srgb, srgb_to_linear
from .fitting import match_pixels
from .paints import pigment_gate, smooth_step, split_light

MOST_FACTOR = 4.0  # highest saturation and gloss
MOST_BRIGHTNESS = 2.0
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear sRGB, Rec. 709
LIT = 0.98  # share of a paint that is no lighter than its lit parts
CLIPPED = 0.9  # sRGB from which on a channel of a highlight may be cut off in the photo
FAINT = 1e-4  # luminance times count of a paint that an object does not show
GLOSS_COST = 0.1  # penalty of gloss when a color is split into paint and gloss
HOLD = 3.0  # how much more a color of another paint counts: it is to stay


@dataclass(frozen=True)
class Surface:
    """How a paint looks beside its color; neutral values change nothing.

    Attributes:
        saturation: Factor of the distance to the gray of the same luminance, 0 to 4; 0 is gray.
        brightness: Lifts or lowers the mid-tones, -2 to 2, in f-stops of what is dark; black and white stay.
        gloss: Factor of the highlights, 0 to 4; 0 is matte.

    Raises:
        TypeError: A value is no number.
        BadRequest: A value is out of range.

    Examples:
        >>> Surface(gloss=0.5).is_identity, Surface().is_identity
        (False, True)
        >>> Surface(saturation=-1)
        Traceback (most recent call last):
        karf_engine.errors.BadRequest: saturation = -1 is out of range. Allowed: 0.0 to 4.0.
    """

    saturation: float = 1.0
    brightness: float = 0.0
    gloss: float = 1.0

    def __post_init__(self) -> None:
        check_fields(self)
        for name in ("saturation", "gloss"):
            check_number(name, getattr(self, name), 0.0, MOST_FACTOR)
        check_number("brightness", self.brightness, -MOST_BRIGHTNESS, MOST_BRIGHTNESS)

    @property
    def is_identity(self) -> bool:
        """Whether all values are neutral."""
        return self == Surface()


def match_surface(
    colors: np.ndarray,
    counts: np.ndarray,
    palette_weights: np.ndarray,
    palette: np.ndarray,
    surfaces: Mapping[int, Surface],
    locked: Iterable[int] = (),
    moved: np.ndarray | None = None,
) -> np.ndarray:
    """The palette with which the paints of some swatches have other surfaces; other paints stay.

    It depends on what it is given alone, so that a value can be moved to and fro.

    Args:
        colors: The object's color histogram, sRGB [n, 3] in [0, 1].
        counts: How often each color occurs, [n], >= 0.
        palette_weights: Of each color, [n, M].
        palette: With which the object has these colors, sRGB [M, 3] in [0, BRIGHTEST].
        surfaces: By the number of the swatch whose paint has it; those of one paint are applied one after the other.
        locked: Entries that stay as they are.
        moved: What is added to each entry before, [M, 3], where surfaces have moved locked ones that are to stay there: the
            others make up for it. By default nothing.

    Returns:
        The edited palette [M, 3] float32 in [0, BRIGHTEST]; bit by bit the given one where all surfaces are neutral.

    Examples:
        >>> palette = np.array([[0, 0, 0], [0.7, 0.1, 0.1]], np.float32)
        >>> weights = np.array([[0.0, 1.0], [0.5, 0.5]])  # a red object, lit and in the shade
        >>> gray = match_surface(weights @ palette, np.ones(2), weights, palette, {1: Surface(saturation=0)})
        >>> print(gray.round(2))
        [[0.   0.   0.  ]
         [0.35 0.35 0.35]]
    """
    targets, reached = colors, np.zeros(len(colors))
    moved = np.zeros_like(palette) if moved is None else moved
    for index in sorted(index for index, surface in surfaces.items() if not surface.is_identity):
        gate = _gate(colors, np.clip(palette[index], 0, 1))
        targets = surface_target(targets, counts, gate, surfaces[index])
        reached = np.maximum(reached, gate)
    if not reached.any():
        return np.array(palette + moved, np.float32)
    importance = counts * (1 + HOLD * (1 - reached))
    return match_pixels(palette_weights, colors + palette_weights @ moved, targets, palette + moved, importance, locked)


def surface_target(colors: np.ndarray, counts: np.ndarray, gate: np.ndarray, surface: Surface) -> np.ndarray:
    """What each color becomes when a paint gets another surface.

    Linear light c = a r + s (1, 1, 1) + rest with the paint's own color r, shading a and gloss s (see `paints`); r is the
    mean of the more saturated half of the paint. Brightness bends a, gloss multiplies s, and saturation draws the whole
    to or from the gray of its luminance.

    Args:
        colors: sRGB [n, 3] in [0, 1].
        counts: How often each color occurs, [n], >= 0.
        gate: How much of each color is of the paint, [n] in [0, 1].
        surface: The surface.

    Returns:
        sRGB [n, 3] float64 in [0, 1]; the colors themselves where the object does not show the paint.

    Examples:
        >>> red = np.array([[0.2, 0.02, 0.02], [0.7, 0.1, 0.1], [0.75, 0.5, 0.5]])  # in the shade, lit, highlight
        >>> surface_target(red, np.array([5, 5, 1]), np.ones(3), Surface(gloss=0)).round(1).tolist()
        [[0.2, 0.0, 0.0], [0.7, 0.1, 0.1], [0.6, 0.1, 0.1]]
    """
    light, counts = srgb_to_linear(colors), counts * gate
    weights = counts * (light @ LUMINANCE)
    if weights.sum() <= FAINT:
        return colors
    paint = _paint(light, weights)
    shading, gloss = split_light(light, paint[None], GLOSS_COST)
    shading = shading[:, 0]
    change = (_bent(shading, 1 / paint.max(), surface.brightness) - shading)[:, None] * paint
    change += (surface.gloss - 1) * _gloss_color(light, paint, shading, gloss, counts)
    result = np.maximum(light + change, 0)
    result = _saturated(result, surface.saturation)
    return np.clip(linear_to_srgb(np.maximum(light + gate[:, None] * (result - light), 0)), 0, 1)


def _gate(colors: np.ndarray, source: np.ndarray) -> np.ndarray:
    """How much of each color is of the source's paint or of its highlights, which have no hue where they are white."""
    return np.maximum(pigment_gate(colors, source), smooth_step(colors.min(axis=1), CLIPPED, 1.0))


def _paint(light: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """A paint's own color [3] of luminance 1: the mean of the more saturated half, which has the least gloss."""
    own = light / np.maximum(light.sum(axis=1, keepdims=True), 1e-9)
    purity = 1 - 3 * own.min(axis=1)
    half = purity >= _quantile(purity, weights, 0.5)
    mean = np.average(own[half], axis=0, weights=weights[half])
    return mean / (mean @ LUMINANCE)


def _saturated(light: np.ndarray, factor: float) -> np.ndarray:
    """Light [n, 3] with the distance to the gray of its luminance multiplied; up to the rim of what a picture can show, as
    a channel that is cut off would change the luminance."""
    gray = (light @ LUMINANCE)[:, None]
    chroma = light - gray
    room = np.where(chroma > 0, 1 - gray, gray) / np.maximum(np.abs(chroma), 1e-9)
    return gray + np.minimum(factor, np.maximum(room.min(axis=1, keepdims=True), 1)) * chroma


def _bent(shading: np.ndarray, white: float, stops: float) -> np.ndarray:
    """The shading [n] along a curve through 0 and `white`, which at 0 is as steep as so many f-stops."""
    steep = 2.0**stops
    return steep * shading / (1 + (steep - 1) * np.minimum(shading / white, 1))


def _gloss_color(
    light: np.ndarray, paint: np.ndarray, shading: np.ndarray, gloss: np.ndarray, counts: np.ndarray
) -> np.ndarray:
    """What gloss adds to each color, [n, 3]: gray light, and the more of it the more of all else that is over the paint,
    as lights have colors. Where a photo has cut it off, it hides the shading: there the paint counts as lit."""
    share = gloss / np.maximum(gloss + shading, 1e-9)
    is_cut = share * smooth_step(light.max(axis=1), srgb_to_linear(np.array(CLIPPED)), 1.0)
    lit = np.maximum(shading, _quantile(shading, counts, LIT))
    over = light - (shading + is_cut * (lit - shading))[:, None] * paint
    return gloss[:, None] + np.maximum(share, is_cut)[:, None] * (over - gloss[:, None])


def _quantile(values: np.ndarray, weights: np.ndarray, share: float) -> float:
    """The value up to which a share of the weights lies."""
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, share * total[-1])])
