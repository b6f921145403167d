"""Paints of a thing: how much of a color is of a paint, and what it becomes when the paint is changed.

Naming: n colors, [n, 3] sRGB in [0, 1]; P paints, each given by a color that an eyedropper picks on it, [P, 3].
"""

from __future__ import annotations

import numpy as np

from ...errors import BadRequest
from ...io.color import lab_chroma, lab_hue, lab_saturation, linear_to_srgb, srgb_to_lab, srgb_to_linear

HUE_GATE = 0.65  # radians of Lab hue at which a color counts as another pigment
PALE = 5.0  # Lab chroma of a source at which a difference of hue counts half
SAME = 1e-3  # radians in linear light up to which colors are equal
GREY_CHROMA, CHROMA_GATE = 6.0, 25.0  # Lab chroma below which a source has no hue; and the gate that then stands in
LEAST_METAL = 0.02  # linear reflectance that a metal has in every channel: less would make noise of what it mirrors
GLOSS_COST = 0.1  # penalty of gloss when a color is split into paint and gloss; white's is 3


def reflection_target(colors: np.ndarray, source: np.ndarray, target: np.ndarray, is_metal: bool = False) -> np.ndarray:
    """What each color becomes when the paint that looks like `source` is changed to look like `target`.

    Linear light c = a r + s (1, 1, 1) + rest with the source r; shading a and gloss s are not negative, found by least
    squares. The paint's part follows: c + gate a (t - r); gate = exp(-(dh / 0.65)^4) of the Lab hue difference dh to
    the source, of which pale paint counts less, leaves other pigments alone. A grey source has no hue: there the chroma
    difference gates. This is the dichromatic model of Shafer (1985), "Using color to separate reflection components",
    with one light. Several paints share each color, the nearer one gets more. A metal has no paint under its gloss: all that
    it shows is what it mirrors, times its own color, so c + gate c (t / r - 1).

    Args:
        colors: sRGB [n, 3] in [0, 1].
        source: sRGB [3] in [0, 1], what an eyedropper shows before; of several paints [P, 3].
        target: The same after the change.
        is_metal: Whether highlights take the paint's color too.

    Returns:
        sRGB [n, 3] float64 in [0, 1].

    Raises:
        BadRequest: A source is black, and so the shading is unknown.

    Examples:
        The source becomes the target, a green next to it stays:

        >>> red, blue, green = np.array([0.7, 0.1, 0.1]), np.array([0.1, 0.2, 0.7]), np.array([0.1, 0.6, 0.2])
        >>> reflection_target(np.stack([red, green]), red, blue).round(3).tolist()
        [[0.1, 0.2, 0.7], [0.1, 0.6, 0.2]]
        >>> reflection_target(np.stack([red, green]), np.stack([red, green]), np.stack([green, red])).round(3).tolist()
        [[0.1, 0.6, 0.2], [0.7, 0.1, 0.1]]

        The highlight of a blue varnish is nearly white, that of a blue metal is blue:

        >>> gold, blue, highlight = np.array([0.8, 0.6, 0.3]), np.array([0.3, 0.5, 0.8]), np.array([[1.0, 0.9, 0.8]])
        >>> [reflection_target(highlight, gold, blue, metal).round(1).tolist() for metal in (False, True)]
        [[[0.8, 0.9, 1.0]], [[0.4, 0.8, 1.0]]]
    """
    sources = np.atleast_2d(source)
    reached = np.max([pigment_gate(colors, each) for each in sources], axis=0)
    return repainted(colors, source, target, reached * _shares(colors, sources), is_metal)


def _shares(colors: np.ndarray, sources: np.ndarray) -> np.ndarray:
    """How much of each color is of each of some paints, [P, n], sums 1."""
    nearness = np.maximum([angles(colors, each) for each in sources], SAME) ** -4.0
    return nearness / nearness.sum(axis=0)


def angles(colors: np.ndarray, source: np.ndarray) -> np.ndarray:
    """The angles [n] of colors to a source in linear light, which shading does not change, radians.

    Examples:
        >>> angles(np.array([[0.8, 0, 0], [0.4, 0, 0], [0, 0.5, 0]]), np.array([0.5, 0, 0])).round(2).tolist()
        [0.0, 0.0, 1.57]
    """
    light, paint = srgb_to_linear(colors), srgb_to_linear(source)
    lengths = np.linalg.norm(light, axis=1) * np.linalg.norm(paint)
    return np.arccos(np.clip(np.divide(light @ paint, lengths, out=np.ones(len(light)), where=lengths > 0), -1, 1))


def repainted(
    colors: np.ndarray, source: np.ndarray, target: np.ndarray, gates: np.ndarray, is_metal: bool = False
) -> np.ndarray:
    """`reflection_target` with any gates [P, n], how much of each color is of each paint; [P, 1] for all alike.

    Examples:
        >>> red, blue, green = np.array([0.7, 0.1, 0.1]), np.array([0.1, 0.2, 0.7]), np.array([[0.1, 0.6, 0.2]])
        >>> repainted(green, red, blue, np.zeros((1, 1))).round(2).tolist()
        [[0.1, 0.6, 0.2]]
    """
    light, sources, targets = (srgb_to_linear(np.atleast_2d(each)) for each in (colors, source, target))
    result = light.copy()
    for r, t, gate in zip(sources, targets, gates, strict=True):
        if _is_black(r):
            raise BadRequest(
                "The source color is black, so its shading cannot be told.", "Pick a lit spot of the object."
            )
        change = (
            light * (t / np.maximum(r, LEAST_METAL) - 1) if is_metal else split_light(light, r)[0][:, None] * (t - r)
        )
        result += gate[:, None] * change
    return np.clip(linear_to_srgb(result), 0, 1)


def is_black(color: np.ndarray) -> bool:
    """Whether a color, sRGB [3] in [0, 1], is too dark to tell a paint by it.

    Examples:
        >>> is_black(np.zeros(3)), is_black(np.array([0.1, 0, 0]))
        (True, False)
    """
    return _is_black(srgb_to_linear(np.asarray(color, np.float64)))


def _is_black(r: np.ndarray) -> bool:
    """The same of linear light."""
    return bool(r @ r < 1e-6)


def split_light(light: np.ndarray, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The factors a >= 0 and s >= 0 [n] of light = a r + s (1, 1, 1) + rest, by least squares with a little cost of s^2.

    The paler the paint, the less it differs from gloss: there the cost decides that light is paint.

    Args:
        light: Linear light [n, 3].
        r: A paint's own, [3], not black.

    Returns:
        Shading a and gloss s.

    Examples:
        >>> shading, gloss = split_light(np.array([[0.5, 0, 0], [1.1, 0.1, 0.1]]), np.array([1.0, 0, 0]))
        >>> print(shading.round(1), gloss.round(1))
        [0.5 1. ] [0.  0.1]
    """
    rr, r1, cr, c1 = r @ r, r.sum(), light @ r, light.sum(axis=1)
    ones = 3 + GLOSS_COST
    determinant = ones * rr - r1 * r1
    paint, gloss = (ones * cr - r1 * c1) / determinant, (rr * c1 - r1 * cr) / determinant
    return np.maximum(np.where(gloss < 0, cr / rr, paint), 0), np.maximum(gloss, 0)


def pigment_gate(colors: np.ndarray, source: np.ndarray, reach: float = 1.0, protect: float = 0.0) -> np.ndarray:
    """1 for colors of the source's pigment, 0 for others, [n]; in the light and in the shade alike.

    Silver, foil and white paper have the hue of what they mirror, or of noise: hue alone takes them for the pigment.

    Args:
        colors: sRGB [n, 3] in [0, 1].
        source: sRGB [3] in [0, 1].
        reach: How far in hue, or in chroma of a grey source, other colors still count; 1 is that of *Becomes*.
        protect: Neutral colors do not count: those whose Lab saturation is under this share of the source's, softly from
            half of it to one and a half; in [0, 1), 0: hue alone decides. Of a grey source nothing.

    Examples:
        >>> reds, green = np.array([[0.7, 0.1, 0.1], [0.3, 0.03, 0.03]]), np.array([[0.1, 0.6, 0.2]])
        >>> pigment_gate(np.vstack([reds, green]), reds[0]).round(2).tolist()
        [1.0, 1.0, 0.0]
        >>> pinkish = np.array([[0.62, 0.6, 0.6]])
        >>> [pigment_gate(pinkish, reds[0], 1.0, protect).round(2).tolist() for protect in (0.0, 0.2)]
        [[0.97], [0.0]]
    """
    lab, source = srgb_to_lab(colors), srgb_to_lab(np.asarray(source, np.float64))
    if lab_chroma(source) < GREY_CHROMA:
        return np.exp(-(((lab_chroma(lab) - lab_chroma(source)) / (reach * CHROMA_GATE)) ** 4))
    turn = (lab_hue(lab) - lab_hue(source) + np.pi) % (2 * np.pi) - np.pi
    turn *= lab_chroma(source) / (lab_chroma(source) + PALE)  # light and noise turn the hue of pale paint
    gate = np.exp(-((turn / (reach * HUE_GATE)) ** 4))
    if protect:
        share = lab_saturation(lab) / lab_saturation(source)
        gate *= smooth_step(share, protect / 2, 3 * protect / 2)
    return gate


def smooth_step(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """0 up to `low`, 1 from `high` on, smooth between.

    Examples:
        >>> smooth_step(np.array([0.0, 1.0, 2.0, 3.0, 9.0]), 1.0, 3.0).tolist()
        [0.0, 0.0, 0.5, 1.0, 1.0]
    """
    x = np.clip((values - low) / (high - low), 0, 1)
    return x * x * (3 - 2 * x)
