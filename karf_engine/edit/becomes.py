"""Swatches that make one color become another: a target for every color of the object, then a bounded fit.

Naming: n colors of an object (histogram cells or pixels), [n, 3] sRGB in [0, 1], with counts [n]. palette_weights
[n, M]: each color's share of the M palette entries; a palette change dP [M, 3] moves the colors by
palette_weights @ dP. Entry 0 is black and never moves; `locked` lists further entries that stay. To match is to find
the palette whose change moves colors to their targets (`fitting`).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..color import lab_chroma, lab_hue, linear_to_srgb, srgb_to_lab, srgb_to_linear
from ..errors import BadRequest
from .fitting import match_pixels, moved, room

HUE_GATE = 0.65  # radians of Lab hue at which a color counts as another pigment
PALE = 5.0  # Lab chroma of a source at which a difference of hue counts half
SAME = 1e-3  # radians between colors in linear light that are the same paint
GREY_CHROMA, CHROMA_GATE = 6.0, 25.0  # Lab chroma below which a source has no hue; and the gate that then stands in
GLOSS_COST = 0.1  # of gloss beside white, 3, when a color is split into paint and gloss
NEAR = 5.0  # Lab distance within which a color looks like another one of the same paint
EMPHASIS = 10.0  # how many times the whole object the picked color counts: it is what the artist looks at


def reflection_target(colors: np.ndarray, source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """What each color becomes when the paint that looks like `source` is changed to look like `target`.

    Linear light c = a r + s (1, 1, 1) + rest with the source r; shading a and gloss s are not negative, found by least
    squares. The paint's part follows: c + gate a (t - r); gate = exp(-(dh / 0.65)^4) of the Lab hue difference dh to
    the source leaves other pigments alone. A grey source has no hue: there the chroma difference gates. This is the
    dichromatic model of Shafer (1985), "Using color to separate reflection components", with one light. Several
    paints share each color, the nearer one gets more.

    Args:
        colors: sRGB [n, 3] in [0, 1].
        source: sRGB [3] in [0, 1], what an eyedropper shows before; of several paints [P, 3].
        target: The same after the change.

    Returns:
        sRGB [n, 3] float64 in [0, 1].

    Raises:
        BadRequest: A source is black, and so the shading is unknown.

    Examples:
        The source becomes the target, a green beside it stays:

        >>> red, blue, green = np.array([0.7, 0.1, 0.1]), np.array([0.1, 0.2, 0.7]), np.array([0.1, 0.6, 0.2])
        >>> reflection_target(np.stack([red, green]), red, blue).round(3).tolist()
        [[0.1, 0.2, 0.7], [0.1, 0.6, 0.2]]
        >>> reflection_target(np.stack([red, green]), np.stack([red, green]), np.stack([green, red])).round(3).tolist()
        [[0.1, 0.6, 0.2], [0.7, 0.1, 0.1]]
    """
    sources = np.atleast_2d(source)
    reached = np.max([pigment_gate(colors, each) for each in sources], axis=0)
    return _repainted(colors, source, target, reached * _shares(colors, sources))


def _shares(colors: np.ndarray, sources: np.ndarray) -> np.ndarray:
    """How much of each color is of each of some paints, [P, n], sums 1: by the angles between them in linear light, which
    shading does not change."""
    light, paints = (srgb_to_linear(each) for each in (colors, sources))
    lengths = np.linalg.norm(light, axis=1) * np.linalg.norm(paints, axis=1)[:, None]
    cosines = np.divide(paints @ light.T, lengths, out=np.ones_like(lengths), where=lengths > 0)
    nearness = np.maximum(np.arccos(np.clip(cosines, -1, 1)), SAME) ** -4.0
    return nearness / nearness.sum(axis=0)


def _repainted(colors: np.ndarray, source: np.ndarray, target: np.ndarray, gates: np.ndarray) -> np.ndarray:
    """`reflection_target` with any gates [P, n]."""
    light, sources, targets = (srgb_to_linear(np.atleast_2d(each)) for each in (colors, source, target))
    result = light.copy()
    for r, t, gate in zip(sources, targets, gates, strict=True):
        if r @ r < 1e-6:
            raise BadRequest(
                "The source color is black, so its shading cannot be told.", "Pick a lit spot of the object."
            )
        result += (gate * _shading(light, r))[:, None] * (t - r)
    return np.clip(linear_to_srgb(result), 0, 1)


def _shading(light: np.ndarray, r: np.ndarray) -> np.ndarray:
    """The factor a >= 0 [n] of light = a r + s (1, 1, 1) + rest, s >= 0, by least squares with a little cost of s^2.

    The paler the paint, the less it differs from gloss: there the cost decides that light is paint.
    """
    rr, r1, cr, c1 = r @ r, r.sum(), light @ r, light.sum(axis=1)
    ones = 3 + GLOSS_COST
    determinant = ones * rr - r1 * r1
    paint, gloss = (ones * cr - r1 * c1) / determinant, (rr * c1 - r1 * cr) / determinant
    return np.maximum(np.where(gloss < 0, cr / rr, paint), 0)


def pigment_gate(colors: np.ndarray, source: np.ndarray, reach: float = 1.0) -> np.ndarray:
    """1 for colors of the source's pigment, 0 for others, [n]; in the light and in the shade alike.

    Args:
        colors: sRGB [n, 3] in [0, 1].
        source: sRGB [3] in [0, 1].
        reach: How far in hue, or in chroma of a grey source, other colors still count; 1 is that of *Becomes*.

    Examples:
        >>> reds, green = np.array([[0.7, 0.1, 0.1], [0.3, 0.03, 0.03]]), np.array([[0.1, 0.6, 0.2]])
        >>> pigment_gate(np.vstack([reds, green]), reds[0]).round(2).tolist()
        [1.0, 1.0, 0.0]
    """
    lab, source = srgb_to_lab(colors), srgb_to_lab(np.asarray(source, np.float64))
    if lab_chroma(source) < GREY_CHROMA:
        return np.exp(-(((lab_chroma(lab) - lab_chroma(source)) / (reach * CHROMA_GATE)) ** 4))
    turn = (lab_hue(lab) - lab_hue(source) + np.pi) % (2 * np.pi) - np.pi
    turn *= lab_chroma(source) / (lab_chroma(source) + PALE)  # light and noise turn the hue of pale paint
    return np.exp(-((turn / (reach * HUE_GATE)) ** 4))


def match_becomes(
    colors: np.ndarray,
    counts: np.ndarray,
    palette_weights: np.ndarray,
    palette: np.ndarray,
    source: np.ndarray,
    target: np.ndarray,
    locked: Iterable[int] = (),
) -> np.ndarray:
    """The palette with which the source's paint becomes the target's, on the whole object, shading and gloss kept.

    It goes on from any edit, where colors and palette are given as that edit shows them.

    Args:
        colors: The object's color histogram, sRGB [n, 3] in [0, 1].
        counts: How often each color occurs, [n], >= 0.
        palette_weights: Of each color, [n, M].
        palette: With which the object has these colors, sRGB [M, 3] in [0, BRIGHTEST].
        source: sRGB [3] in [0, 1], a color of the object now; of several paints [P, 3].
        target: sRGB [3] in [0, 1], what it is to become; of several paints [P, 3].
        locked: Entries that stay as they are.

    Returns:
        The edited palette [M, 3] float32 in [0, BRIGHTEST].

    Raises:
        BadRequest: The source is black.

    Examples:
        >>> palette = np.array([[0, 0, 0], [0.7, 0.1, 0.1]], np.float32)
        >>> weights = np.array([[0.0, 1.0], [0.5, 0.5]])  # a red object, lit and in the shade
        >>> blue = np.array([0.1, 0.2, 0.7])
        >>> edited = match_becomes(weights @ palette, np.ones(2), weights, palette, palette[1], blue)
        >>> print(edited.round(2))
        [[0.  0.  0. ]
         [0.1 0.2 0.7]]
    """
    targets = reflection_target(colors, source, target)
    return _matched(colors, counts, palette_weights, palette, source, target, targets, locked)


def match_pigment(
    colors: np.ndarray,
    counts: np.ndarray,
    palette_weights: np.ndarray,
    palette: np.ndarray,
    source: np.ndarray,
    target: np.ndarray,
    reach: float,
) -> np.ndarray:
    """`match_becomes` of one pigment by itself: other colors of the object have no say, as swatches of their own serve
    them. reach: see `pigment_gate`.

    Examples:
        Of a red and a green that are of one swatch, the green does not hold the red back:

        >>> palette, weights = np.array([[0, 0, 0], [0.5, 0.5, 0.1]]), np.array([[0.0, 1.0], [0.0, 1.0]])
        >>> red, green, blue = np.array([0.7, 0.1, 0.1]), np.array([0.1, 0.6, 0.2]), np.array([0.1, 0.2, 0.7])
        >>> change = match_pigment(np.stack([red, green]), np.ones(2), weights, palette, red, blue, 1.0) - palette
        >>> print(change[1].round(2))
        [-0.5  0.1  0.6]
    """
    counts = counts * pigment_gate(colors, source, reach)
    targets = _repainted(colors, source, target, np.ones((1, 1)))
    return _matched(colors, counts, palette_weights, palette, source, target, targets, ())


def _matched(
    colors: np.ndarray,
    counts: np.ndarray,
    palette_weights: np.ndarray,
    palette: np.ndarray,
    source: np.ndarray,
    target: np.ndarray,
    targets: np.ndarray,
    locked: Iterable[int],
) -> np.ndarray:
    """The palette [M, 3] that moves colors to their targets, and above all the sources to their own."""
    sources = np.atleast_2d(source)
    own = [mean_weights(colors, counts, palette_weights, each) for each in sources]
    emphasis = EMPHASIS * max(np.sum(counts), 1e-9) / len(sources)  # an object may show nothing like the source
    palette_weights, colors = np.vstack([palette_weights, *own]), np.vstack([colors, sources])
    targets, counts = np.vstack([targets, target]), np.append(counts, [emphasis] * len(sources))
    return match_pixels(palette_weights, colors, targets, palette, counts, locked)


def match_fewest(
    palette_weights_of_pixel: np.ndarray,
    palette: np.ndarray,
    target: np.ndarray,
    locked: Iterable[int] = (),
    shown: np.ndarray | None = None,
) -> np.ndarray:
    """The palette that gives one pixel the target color and touches as few swatches as it can.

    Minimises the sum of the swatches' moves `|dP_j|` (an L2,1 norm; the rule of LoCoPalettes) by iteratively reweighted
    least squares, each step solved exactly within 0 <= P + dP <= max(1, P). A target out of reach is met as closely as
    the box lets it, channel by channel.

    Args:
        palette_weights_of_pixel: [M].
        palette: With which it has its color, sRGB [M, 3] in [0, BRIGHTEST].
        target: sRGB [3] in [0, 1].
        locked: Entries that stay as they are.
        shown: The pixel's color now, sRGB [3]; by default what the palette gives.

    Returns:
        The edited palette [M, 3] float32.

    Examples:
        Of two swatches that make up a pixel, the one with the larger share moves:

        >>> palette = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
        >>> match_fewest(np.array([0, 0.8, 0.2]), palette, np.array([0.4, 0.2, 0])).round(2).tolist()
        [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 1.0, 0.0]]
    """
    weights = np.asarray(palette_weights_of_pixel, np.float64)
    lower, upper = room(palette, locked, np.maximum(1.0, palette))  # what is brighter than white may stay
    shown = weights @ np.asarray(palette, np.float64) if shown is None else shown
    wanted = np.clip(np.subtract(target, shown), weights @ lower, weights @ upper)
    stiffness = np.ones(len(weights))
    for _ in range(40):
        pull = weights / stiffness
        change = np.stack([_shared_pull(weights, pull, wanted[c], lower[:, c], upper[:, c]) for c in range(3)], axis=1)
        # the floor keeps a still swatch movable; 1e-6 is far under a step of 8 bits
        stiffness = 1 / np.maximum(np.linalg.norm(change, axis=1), 1e-6)
    return moved(palette, change)


def nearest_weights(colors: np.ndarray, palette_weights: np.ndarray, color: np.ndarray) -> np.ndarray:
    """Palette weights of the histogram color nearest in Lab to a color.

    Args:
        colors: The histogram, sRGB [n, 3] in [0, 1].
        palette_weights: Of each of its colors, [n, M].
        color: What an eyedropper shows, sRGB [3] in [0, 1].

    Returns:
        [M].

    Examples:
        >>> nearest_weights(np.array([[1.0, 0, 0], [0, 0, 1.0]]), np.eye(2), np.array([0.1, 0.2, 0.8])).tolist()
        [0.0, 1.0]
    """
    distance = np.linalg.norm(srgb_to_lab(colors) - srgb_to_lab(color), axis=1)
    return palette_weights[int(distance.argmin())]


def near(colors: np.ndarray, color: np.ndarray, or_nearest: bool = True) -> np.ndarray:
    """Which colors [n, 3] look like a color [3]: those within 5 of it in Lab.

    Args:
        colors: sRGB [n, 3].
        color: sRGB [3].
        or_nearest: Where none does, take the nearest.

    Returns:
        bool [n].

    Examples:
        >>> near(np.array([[0.5, 0.5, 0.5], [0.52, 0.5, 0.5], [0.9, 0.5, 0.5]]), np.array([0.51, 0.5, 0.5])).tolist()
        [True, True, False]
    """
    distance = np.linalg.norm(srgb_to_lab(colors) - srgb_to_lab(color), axis=1)
    return distance <= (max(NEAR, distance.min()) if or_nearest else NEAR)


def mean_weights(colors: np.ndarray, counts: np.ndarray, palette_weights: np.ndarray, color: np.ndarray) -> np.ndarray:
    """Palette weights [M] of what looks like a color; arguments as those of `match_becomes`.

    Examples:
        >>> colors = np.array([[1.0, 0, 0], [0.99, 0, 0], [0, 0, 1.0]])
        >>> mean_weights(colors, np.array([3, 1, 9]), np.eye(3), np.array([1.0, 0, 0])).tolist()
        [0.75, 0.25, 0.0]
    """
    alike = near(colors, color)
    return np.average(palette_weights[alike], axis=0, weights=np.maximum(counts[alike], 1e-9))


def _shared_pull(
    weights: np.ndarray, pull: np.ndarray, wanted: float, lower: np.ndarray, upper: np.ndarray
) -> np.ndarray:
    """x = clip(m pull, lower, upper) [M] with the multiplier m for which weights @ x = wanted."""
    # weights @ x grows with m and is linear between the breaks where an entry meets its bound
    movable = pull > 0
    breaks = np.concatenate([lower[movable] / pull[movable], upper[movable] / pull[movable], [0.0]])
    breaks = np.unique(breaks)
    reached = np.clip(breaks[:, None] * pull, lower, upper) @ weights
    multiplier = np.interp(wanted, reached, breaks)
    return np.clip(multiplier * pull, lower, upper)
