"""Swatches that make one color become another: a target for every color of the object, then a bounded fit.

Naming: n colors of an object (histogram cells or pixels), [n, 3] sRGB in [0, 1], with counts [n]. palette_weights
[n, M]: each color's share of the M palette entries; a palette change dP [M, 3] moves the colors by
palette_weights @ dP. Entry 0 is black and never moves; `locked` lists further entries that stay. To match is to find
the palette whose change moves colors to their targets (`fitting`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from ...io.color import srgb_to_lab
from .fitting import bounds, match_pixels, match_seen, moved
from .paints import angles, is_black, paints_of, pigment_gate, reflection_target, repainted

OTHER = 0.2  # radians in linear light from which on colors are of different paints; sun and open shade are .12 apart
REACHED = 0.1  # share of a paint from which on it would be taken along
NEAR = 5.0  # Lab distance within which a color looks like another one of the same paint
# weight of the picked colors relative to the whole object: the artist looks at them. By CIEDE2000 what can be met is met with
# little weight, and more would give all to two picks that no palette can move apart
EMPHASIS, EMPHASIS_OF_SQUARES = 1.0, 10.0


def with_held(
    colors: np.ndarray, source: np.ndarray, target: np.ndarray, held: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Sources and targets [P, 3] of one paint that changes, and of those that stay, as they were given their color before.

    Args:
        colors: What the object shows now, sRGB [n, 3].
        source: sRGB [3].
        target: sRGB [3].
        held: Colors that stay, sRGB [3] each. One that the object does not show, or of the source's own paint, is no
            paint to hold.

    Examples:
        A teal is held, a darker red is of the paint that changes:

        >>> red, blue, teal = np.array([0.8, 0.1, 0.1]), np.array([0.1, 0.2, 0.7]), np.array([0.1, 0.6, 0.6])
        >>> colors = np.stack([red, red / 2, teal])
        >>> with_held(colors, red, blue, [teal, red / 2, blue])[0].tolist()
        [[0.8, 0.1, 0.1], [0.1, 0.6, 0.6]]
    """
    kept = [
        each for each in held if near(colors, each, or_nearest=False).any() and angles(source[None], each)[0] > OTHER
    ]
    return np.stack([source, *kept]), np.stack([target, *kept])


def with_unasked(
    colors: np.ndarray, counts: np.ndarray, source: np.ndarray, target: np.ndarray, is_metal: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Sources and targets [P, 3] with a pair more for each paint of the object that nobody asked to change, so that it stays.

    Paints of other hues stay by themselves: their gate is closed. A metal has no paints: what it shows is what it mirrors.

    colors, counts: the object's histogram, [n, 3] and [n]. source, target: [3] or [P, 3].

    Examples:
        A bowl is violet and half of it of a bluer violet; the first is to be green:

        >>> violet, bluer, green = np.array([0.5, 0.3, 0.5]), np.array([0.3, 0.3, 0.6]), np.array([0.1, 0.5, 0.2])
        >>> sources, targets = with_unasked(np.stack([violet, bluer]), np.ones(2), violet, green)
        >>> sources.tolist(), targets.tolist()
        ([[0.5, 0.3, 0.5], [0.3, 0.3, 0.6]], [[0.1, 0.5, 0.2], [0.3, 0.3, 0.6]])
    """
    sources = np.atleast_2d(source)
    paints = np.empty((0, 3)) if is_metal else paints_of(colors, counts)
    is_reached = np.max([pigment_gate(paints, each) for each in sources], axis=0) > REACHED
    others = [each for each in paints[is_reached] if angles(sources, each).min() > OTHER and not is_black(each)]
    return np.stack([*sources, *others]), np.stack([*np.atleast_2d(target), *others])


def match_becomes(
    colors: np.ndarray,
    counts: np.ndarray,
    palette_weights: np.ndarray,
    palette: np.ndarray,
    source: np.ndarray,
    target: np.ndarray,
    locked: Iterable[int] = (),
    is_metal: bool = False,
) -> np.ndarray:
    """The palette with which the source's paint becomes the target's, on the whole object, shading and gloss kept.

    It continues from any edit, where colors and palette are given as that edit shows them. Other paints of the object hold.

    Args:
        colors: The object's color histogram, sRGB [n, 3] in [0, 1].
        counts: How often each color occurs, [n], >= 0.
        palette_weights: Of each color, [n, M].
        palette: With which the object has these colors, sRGB [M, 3] in [0, BRIGHTEST].
        source: sRGB [3] in [0, 1], a color of the object now; of several paints [P, 3].
        target: sRGB [3] in [0, 1], what it is to become; of several paints [P, 3].
        locked: Entries that stay as they are.
        is_metal: Whether highlights take the paint's color, and not the light's.

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
    source, target = with_unasked(colors, counts, source, target, is_metal)
    targets = reflection_target(colors, source, target, is_metal)
    return _matched(colors, counts, palette_weights, palette, source, target, targets, locked, match_seen, EMPHASIS)


def match_dragged(
    colors: np.ndarray,
    counts: np.ndarray,
    palette_weights: np.ndarray,
    palette: np.ndarray,
    index: int,
    color: np.ndarray,
    locked: Iterable[int] = (),
    is_metal: bool = False,
) -> np.ndarray:
    """The palette in which a swatch has a new color and its paint's other swatches follow it, shading and gloss kept.

    As `match_becomes` from the swatch's color to the new one, but that the swatch is just what it is given. So it can be
    dragged: the result is that of the last color alone.

    Args:
        colors: The object's color histogram, sRGB [n, 3] in [0, 1].
        counts: How often each color occurs, [n], >= 0.
        palette_weights: Of each color, [n, M].
        palette: With which the object has these colors, sRGB [M, 3] in [0, BRIGHTEST].
        index: The swatch that is dragged.
        color: Its new color, sRGB [3] in [0, BRIGHTEST].
        locked: Other entries that stay as they are.
        is_metal: Whether highlights take the paint's color, and not the light's.

    Returns:
        The edited palette [M, 3] float32 in [0, BRIGHTEST]. Of a black swatch nothing tells the paint: it alone changes.

    Examples:
        A red object of a lit and a dark swatch turns blue as a whole:

        >>> palette = np.array([[0, 0, 0], [0.7, 0.1, 0.1], [0.35, 0.05, 0.05]], np.float32)
        >>> weights = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        >>> edited = match_dragged(weights @ palette, np.ones(2), weights, palette, 1, np.array([0.1, 0.1, 0.7]))
        >>> print(edited.round(2))
        [[0.   0.   0.  ]
         [0.1  0.1  0.7 ]
         [0.05 0.05 0.35]]
    """
    start = np.array(palette, np.float32)
    start[index] = color
    change = start[index] - palette[index]
    source = np.clip(palette[index], 0, 1)
    if not change.any() or is_black(source):
        return start
    targets = reflection_target(colors, source, start[index], is_metal)
    moved_alone = colors + palette_weights[:, index, None] * change
    return match_pixels(palette_weights, moved_alone, targets, start, counts, [index, *locked])


def match_pigment(
    colors: np.ndarray,
    counts: np.ndarray,
    palette_weights: np.ndarray,
    palette: np.ndarray,
    source: np.ndarray,
    target: np.ndarray,
    reach: float,
    protect: float = 0.0,
) -> np.ndarray:
    """`match_becomes` of one pigment by itself: other colors of the object do not count, as swatches of their own serve
    them. reach, protect: see `pigment_gate`.

    Examples:
        Of a red and a green that are of one swatch, the green does not hold the red back:

        >>> palette, weights = np.array([[0, 0, 0], [0.5, 0.5, 0.1]]), np.array([[0.0, 1.0], [0.0, 1.0]])
        >>> red, green, blue = np.array([0.7, 0.1, 0.1]), np.array([0.1, 0.6, 0.2]), np.array([0.1, 0.2, 0.7])
        >>> change = match_pigment(np.stack([red, green]), np.ones(2), weights, palette, red, blue, 1.0) - palette
        >>> print(change[1].round(2))
        [-0.5  0.1  0.6]
    """
    counts = counts * pigment_gate(colors, source, reach, protect)
    targets = repainted(colors, source, target)
    given = colors, counts, palette_weights, palette, source, target, targets, ()
    return _matched(*given, match_pixels, EMPHASIS_OF_SQUARES)


def _matched(
    colors: np.ndarray,
    counts: np.ndarray,
    palette_weights: np.ndarray,
    palette: np.ndarray,
    source: np.ndarray,
    target: np.ndarray,
    targets: np.ndarray,
    locked: Iterable[int],
    match: Callable[..., np.ndarray],
    emphasis: float,
) -> np.ndarray:
    """The palette [M, 3] that moves colors to their targets, and above all the sources to their own."""
    sources = np.atleast_2d(source)
    own = [mean_weights(colors, counts, palette_weights, each) for each in sources]
    of_each = emphasis * max(np.sum(counts), 1e-9) / len(sources)  # an object may show nothing like the source
    palette_weights, colors = np.vstack([palette_weights, *own]), np.vstack([colors, sources])
    targets, counts = np.vstack([targets, target]), np.append(counts, [of_each] * len(sources))
    return match(palette_weights, colors, targets, palette, counts, locked)


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
    lower, upper = bounds(palette, locked, np.maximum(1.0, palette))  # what is brighter than white may stay
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
