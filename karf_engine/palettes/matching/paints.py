"""Paints of a thing: how much of a color is of a paint, and what it becomes when the paint is changed.

Naming: n colors, [n, 3] sRGB in [0, 1]; P paints, each given by a color that an eyedropper picks on it, [P, 3].
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from ...errors import BadRequest
from ...io.color import lab_chroma, lab_hue, lab_saturation, linear_to_srgb, srgb_to_lab, srgb_to_linear

HUE_GATE = 0.65  # radians of Lab hue at which a color counts as another pigment
PALE = 5.0  # Lab chroma of a source at which a difference of hue counts half
SAME = 1e-3  # radians in linear light up to which colors are equal
GREY_CHROMA, CHROMA_GATE = 6.0, 25.0  # Lab chroma below which a source has no hue; and the gate that then stands in
LEAST_METAL = 0.02  # linear reflectance that a metal has in every channel: less would make noise of what it mirrors
GLOSS_COST = 0.2  # penalty of gloss when a color is split into a paint and gloss; white's is 3
GLOSS_COST_OF_SEVERAL = 0.1  # the same of several paints, of which the palest takes what is pale
MIXED = 0.1  # share of all but its first paint from which on a color is a mixture
CHANNELS = 3
FAINT = 1e-5  # linear light that is as good as none
# of `paints_of`, in radians in linear light. All these numbers were chosen on drawn scenes, seeds 0 to 7, 20 to 22 and 200
# to 219, where the choice makes little difference
SPREAD = 0.07  # of a paint's colors about it
LEAST_PAINT = 0.15  # share of the object


def reflection_target(colors: np.ndarray, source: np.ndarray, target: np.ndarray, is_metal: bool = False) -> np.ndarray:
    """What each color becomes when the paint that looks like `source` is changed to look like `target`.

    Linear light c = sum_p a_p r_p + s (1, 1, 1) + rest with the sources r_p; shadings a and gloss s are not negative, found by
    least squares (`split_light`). The paints' parts follow: c + gate k sum_p a_p (t_p - r_p). gate = exp(-(dh / 0.65)^4) of the
    Lab hue difference dh to the nearest source, of which pale paint counts less, leaves other pigments alone; what is a mixture
    of sources is not held back. A grey source has no hue: there the chroma difference gates. k, by channel, is the tint of the
    light: what c has of the channel for what the paints have of it, drawn to 1 where these are dark. This is the dichromatic
    model of Shafer (1985), "Using color to separate reflection components", of a mixture of paints. A metal has no paint under
    its gloss: all that it shows is what it mirrors, times its own color, so c + gate c (t / r - 1); of several metals the nearer
    one gets more of a color.

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
        [[[0.7, 0.8, 1.0]], [[0.4, 0.8, 1.0]]]
    """
    light, sources, targets = _linear(colors, source, target)
    gate = np.max([pigment_gate(colors, each) for each in np.atleast_2d(source)], axis=0)[:, None]
    change = _change_of_metals if is_metal else _change_of_paints
    return _shown(light + change(light, sources, targets, gate))


def repainted(colors: np.ndarray, source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """What each color becomes as far as it holds a pigment, whatever else it holds: c + a (t - r), without gate and tint.

    Arguments, result and errors as those of `reflection_target`, with one source and target [3].

    Examples:
        What is half red paint and half silver keeps its silver:

        >>> red, blue, mixed = np.array([0.7, 0.1, 0.1]), np.array([0.1, 0.2, 0.7]), np.array([[0.66, 0.49, 0.49]])
        >>> repainted(mixed, red, blue).round(1).tolist()
        [[0.5, 0.5, 0.7]]
    """
    light, sources, targets = _linear(colors, source, target)
    shading, _ = split_light(light, sources, GLOSS_COST_OF_SEVERAL)
    return _shown(light + shading @ (targets - sources))


def _linear(colors: np.ndarray, source: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, ...]:
    """Linear light of colors [n, 3], sources and targets [P, 3]; raises BadRequest for a source that is black."""
    light, sources, targets = (srgb_to_linear(np.atleast_2d(each)) for each in (colors, source, target))
    if any(map(_is_black, sources)):
        raise BadRequest("The source color is black, so its shading cannot be told.", "Pick a lit spot of the object.")
    return light, sources, targets


def _shown(light: np.ndarray) -> np.ndarray:
    return np.clip(linear_to_srgb(np.maximum(light, 0)), 0, 1)


def _change_of_paints(light: np.ndarray, sources: np.ndarray, targets: np.ndarray, gate: np.ndarray) -> np.ndarray:
    """By how much linear light [n, 3] changes with its paints [P, 3]; gate: [n, 1]."""
    shading, gloss = split_light(light, sources, GLOSS_COST if len(sources) == 1 else GLOSS_COST_OF_SEVERAL)
    paint = shading @ sources
    doubt = paint.mean(axis=1, keepdims=True) + FAINT  # a dark channel of the paint tells the light's tint by its noise
    tint = (np.maximum(light - gloss[:, None], 0) + doubt) / (paint + doubt)
    of_each = shading * np.linalg.norm(sources, axis=1)
    rest = of_each.sum(axis=1) - of_each.max(axis=1)
    mixed = np.minimum(rest / (MIXED * (of_each.sum(axis=1) + FAINT)), 1)[:, None]
    return (mixed + (1 - mixed) * gate) * tint * (shading @ (targets - sources))


def _change_of_metals(light: np.ndarray, sources: np.ndarray, targets: np.ndarray, gate: np.ndarray) -> np.ndarray:
    """The same of metals."""
    nearness = np.maximum([_angles(light, each) for each in sources], SAME) ** -4.0
    factors = targets / np.maximum(sources, LEAST_METAL)
    return gate * light * ((nearness / nearness.sum(axis=0)).T @ (factors - 1))


def paints_of(colors: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """The paints that an object shows most, sRGB [Q, 3]: where its colors are densest by their direction in linear light, which
    shading does not change.

    Args:
        colors: The object's color histogram, sRGB [n, 3] in [0, 1].
        counts: How often each color occurs, [n], >= 0.

    Returns:
        The mean color of each, the densest first. A peak that less than 15 % of the object lie around is none: gloss, noise.

    Examples:
        A red, lit and in the shade, and a green:

        >>> red, green = np.array([0.7, 0.1, 0.1]), np.array([0.1, 0.6, 0.2])
        >>> print(paints_of(np.stack([red, red / 2, green]), np.array([3, 3, 2])).round(2))
        [[0.52 0.08 0.08]
         [0.1  0.6  0.2 ]]
    """
    light = srgb_to_linear(colors)
    length = np.linalg.norm(light, axis=1)
    is_lit = (length > FAINT) & (counts > 0)
    colors, counts = colors[is_lit], counts[is_lit]
    directions = light[is_lit] / length[is_lit, None]
    cosines = directions @ directions.T
    density = (
        np.exp((cosines - 1) / np.float32(SPREAD**2)) @ counts
    )  # von Mises and Fisher's kernel, a Gaussian on the sphere
    around = cosines >= np.cos(2 * SPREAD)
    is_peak = density >= np.where(around, density, 0).max(axis=1, initial=0)
    is_peak &= around @ counts >= LEAST_PAINT * counts.sum()
    peaks = np.flatnonzero(is_peak)
    peaks = peaks[np.argsort(-density[peaks], kind="stable")]
    own = cosines[peaks] >= np.cos(SPREAD)
    return np.array([np.average(colors[each], axis=0, weights=counts[each]) for each in own]).reshape(-1, 3)


def angles(colors: np.ndarray, source: np.ndarray) -> np.ndarray:
    """The angles [n] of colors to a source in linear light, which shading does not change, radians.

    Examples:
        >>> angles(np.array([[0.8, 0, 0], [0.4, 0, 0], [0, 0.5, 0]]), np.array([0.5, 0, 0])).round(2).tolist()
        [0.0, 0.0, 1.57]
    """
    return _angles(srgb_to_linear(colors), srgb_to_linear(source))


def _angles(light: np.ndarray, paint: np.ndarray) -> np.ndarray:
    """The same of linear light."""
    lengths = np.linalg.norm(light, axis=1) * np.linalg.norm(paint)
    return np.arccos(np.clip(np.divide(light @ paint, lengths, out=np.ones(len(light)), where=lengths > 0), -1, 1))


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


def split_light(light: np.ndarray, paints: np.ndarray, gloss_cost: float) -> tuple[np.ndarray, np.ndarray]:
    """The factors a >= 0 and s >= 0 of light = sum_p a_p r_p + s (1, 1, 1) + rest, by least squares with a little cost of s^2.

    The paler the paint, the less it differs from gloss: there the cost decides that light is paint.

    Args:
        light: Linear light [n, 3].
        paints: Their own linear light r [P, 3], none black.
        gloss_cost: That of s^2.

    Returns:
        Shadings a [n, P] and gloss s [n]. At most three of them are not 0, as a color has three channels.

    Examples:
        >>> shading, gloss = split_light(np.array([[0.5, 0, 0], [1.1, 0.1, 0.1]]), np.array([[1.0, 0, 0]]), 0.1)
        >>> print(shading.round(1).tolist(), gloss.round(1).tolist())
        [[0.5], [1.0]] [0.0, 0.1]

        What is half red and half green is no gloss:

        >>> mixed, paints = np.array([[0.4, 0.3, 0.0]]), np.array([[0.8, 0.0, 0.0], [0.0, 0.6, 0.0]])
        >>> print(split_light(mixed, paints, 0.1)[0].round(1))
        [[0.5 0.5]]
    """
    parts = np.hstack([np.vstack([paints, np.ones(CHANNELS)]), np.zeros((len(paints) + 1, 1))])
    parts[-1, -1] = np.sqrt(gloss_cost)
    wanted = np.hstack([light, np.zeros((len(light), 1))])
    factors, least = np.zeros((len(light), len(parts))), np.full(len(light), np.inf)
    # all sets of parts that can be the ones above 0: few, as there are few paints
    for size in range(CHANNELS + 1):
        for used in map(list, combinations(range(len(parts)), size)):
            # two paints of one color are told apart by nothing: a trace of ridge halves between them
            inverse = np.linalg.inv(parts[used] @ parts[used].T + 1e-9 * np.eye(size))
            found = wanted @ parts[used].T @ inverse
            rest = ((wanted - found @ parts[used]) ** 2).sum(axis=1)
            is_better = (found >= 0).all(axis=1) & (rest < least)
            factors[is_better], least[is_better] = 0, rest[is_better]
            factors[np.ix_(is_better, used)] = found[is_better]
    return factors[:, :-1], factors[:, -1]


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
