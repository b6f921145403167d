"""Paints of an object: their shares of its colors, and the colors after a paint has changed.

n colors are sRGB [n, 3] in [0, 1]; each of P paints is given by a color picked on it, [P, 3].
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from ...errors import BadRequest
from ...io.color import lab_chroma, lab_hue, lab_saturation, linear_to_srgb, srgb_to_lab, srgb_to_linear

HUE_GATE = 0.65  # width of the gate in Lab hue, radians
PALE = 5.0  # Lab chroma of a source that halves hue differences
SAME = 1e-3  # angle in linear light, radians, of equal colors
GREY_CHROMA, CHROMA_GATE = 6.0, 25.0  # Lab chroma below which a source is gray, and the width of its gate
MIN_METAL = 0.02  # least linear reflectance of a metal in a channel: limits the noise in reflections
GLOSS_COST, GLOSS_COST_OF_SEVERAL = 0.2, 0.1  # penalty of gloss beside one paint, and beside several
MIXED = 0.1  # least share of secondary paints in a mixture
CHANNELS = 3
FAINT = 1e-5  # negligible linear light
SPREAD = 0.07  # of a paint's colors about their mean, radians in linear light
MIN_PAINT = 0.15  # share of the object


def reflection_target(colors: np.ndarray, source: np.ndarray, target: np.ndarray, is_metal: bool = False) -> np.ndarray:
    """Return colors, sRGB [n, 3] float64 in [0, 1], after the paints of color `source` have changed to color `target`.

    By the dichromatic model of Shafer (1985), "Using color to separate reflection components", linear light is
    c = sum_p a_p r_p + s (1, 1, 1) + rest, with sources r_p, shadings a and gloss s (`separate_dichromatic`). The
    result is c + gate k sum_p a_p (t_p - r_p). gate (`pigment_gate`, 1 for mixtures of sources) excludes other
    pigments. k, per channel, is the tint of the light: (c - s) / sum_p a_p r_p, drawn to 1 where the paint is dark.

    A metal, whose highlights take its color too, shows reflections times its own color: c + gate c (t / r - 1),
    averaged over the metals by nearness.

    Source and target are sRGB [3] or [P, 3] in [0, 1]. Raises BadRequest if a source is black: its shading is unknown.
    """
    light, sources, targets = _linear(colors, source, target)
    gate = np.max([pigment_gate(colors, each) for each in np.atleast_2d(source)], axis=0)[:, None]
    change = _change_of_metals if is_metal else _change_of_paints
    return _shown(light + change(light, sources, targets, gate))


def repainted(colors: np.ndarray, source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Like `reflection_target` for one source, without gate and tint: c + a (t - r)."""
    light, sources, targets = _linear(colors, source, target)
    shading, _ = separate_dichromatic(light, sources, GLOSS_COST_OF_SEVERAL)
    return _shown(light + shading @ (targets - sources))


def _linear(colors: np.ndarray, source: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the linear light of colors [n, 3], sources and targets [P, 3]; raise BadRequest for a black source."""
    light, sources, targets = (srgb_to_linear(np.atleast_2d(each)) for each in (colors, source, target))
    if any(map(is_black, np.atleast_2d(source))):
        raise BadRequest("The source color is black, so its shading cannot be told.", "Pick a lit spot of the object.")
    return light, sources, targets


def _shown(light: np.ndarray) -> np.ndarray:
    return np.clip(linear_to_srgb(np.maximum(light, 0)), 0, 1)


def _change_of_paints(light: np.ndarray, sources: np.ndarray, targets: np.ndarray, gate: np.ndarray) -> np.ndarray:
    """Return the change of linear light [n, 3] with that of its paints [P, 3]; gate [n, 1]."""
    shading, gloss = separate_dichromatic(light, sources, GLOSS_COST if len(sources) == 1 else GLOSS_COST_OF_SEVERAL)
    paint = shading @ sources
    damping = paint.mean(axis=1, keepdims=True) + FAINT  # in dark channels the tint is noise
    tint = (np.maximum(light - gloss[:, None], 0) + damping) / (paint + damping)
    of_paint = shading * np.linalg.norm(sources, axis=1)
    secondary = of_paint.sum(axis=1) - of_paint.max(axis=1)
    mixed = np.minimum(secondary / (MIXED * (of_paint.sum(axis=1) + FAINT)), 1)[:, None]
    return (mixed + (1 - mixed) * gate) * tint * (shading @ (targets - sources))


def _change_of_metals(light: np.ndarray, sources: np.ndarray, targets: np.ndarray, gate: np.ndarray) -> np.ndarray:
    """Return the change of linear light [n, 3] with that of its metals [P, 3]; gate [n, 1]."""
    nearness = np.maximum([_angles(light, each) for each in sources], SAME) ** -4.0
    factors = targets / np.maximum(sources, MIN_METAL)
    return gate * light * ((nearness / nearness.sum(axis=0)).T @ (factors - 1))


def paints_of(colors: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Return the main paints of an object, sRGB [Q, 3]: the modes of its colors' directions in linear light.

    Directions are independent of shading. A mode with less than 15 % of the object around it (gloss, noise) is ignored.
    The result is the mean color of each mode, the densest first; counts [n] is the frequency of each color.
    """
    light = srgb_to_linear(colors)
    length = np.linalg.norm(light, axis=1)
    is_lit = (length > FAINT) & (counts > 0)
    colors, counts = colors[is_lit], counts[is_lit]
    directions = light[is_lit] / length[is_lit, None]
    cosines = directions @ directions.T
    density = np.exp((cosines - 1) / np.float32(SPREAD**2)) @ counts  # von Mises-Fisher kernel
    is_around = cosines >= np.cos(2 * SPREAD)
    is_peak = density >= np.where(is_around, density, 0).max(axis=1, initial=0)
    is_peak &= is_around @ counts >= MIN_PAINT * counts.sum()
    peaks = np.flatnonzero(is_peak)
    peaks = peaks[np.argsort(-density[peaks], kind="stable")]
    members = cosines[peaks] >= np.cos(SPREAD)
    return np.array([np.average(colors[each], axis=0, weights=counts[each]) for each in members]).reshape(-1, 3)


def angles(colors: np.ndarray, source: np.ndarray) -> np.ndarray:
    """Return the angles [n] between colors and a source in linear light, radians; independent of shading."""
    return _angles(srgb_to_linear(colors), srgb_to_linear(source))


def _angles(light: np.ndarray, paint: np.ndarray) -> np.ndarray:
    lengths = np.linalg.norm(light, axis=1) * np.linalg.norm(paint)
    return np.arccos(np.clip(np.divide(light @ paint, lengths, out=np.ones(len(light)), where=lengths > 0), -1, 1))


def is_black(color: np.ndarray) -> bool:
    """Return whether a color, sRGB [3] in [0, 1], is too dark to determine its paint."""
    light = srgb_to_linear(color)
    return bool(light @ light < 1e-6)


def separate_dichromatic(light: np.ndarray, paints: np.ndarray, gloss_cost: float) -> tuple[np.ndarray, np.ndarray]:
    """Decompose linear light [n, 3] into sum_p a_p r_p + s (1, 1, 1) + rest with a, s >= 0.

    Paints r [P, 3] are linear light, none black. Minimises the squared rest plus gloss_cost s^2, which attributes light
    to paint rather than gloss where the paint is pale. Returns shadings a [n, P] and gloss s [n]; at most three of them
    per color are not 0.
    """
    parts = np.hstack([np.vstack([paints, np.ones(CHANNELS)]), np.zeros((len(paints) + 1, 1))])
    parts[-1, -1] = np.sqrt(gloss_cost)
    wanted = np.hstack([light, np.zeros((len(light), 1))])
    factors, least = np.zeros((len(light), len(parts))), np.full(len(light), np.inf)
    # enumerate the sets of positive factors: few, as there are few paints
    for size in range(CHANNELS + 1):
        for used in map(list, combinations(range(len(parts)), size)):
            # a minimal ridge divides evenly between two paints of the same color
            inverse = np.linalg.inv(parts[used] @ parts[used].T + 1e-9 * np.eye(size))
            solution = wanted @ parts[used].T @ inverse
            residual = ((wanted - solution @ parts[used]) ** 2).sum(axis=1)
            is_better = (solution >= 0).all(axis=1) & (residual < least)
            factors[is_better], least[is_better] = 0, residual[is_better]
            factors[np.ix_(is_better, used)] = solution[is_better]
    return factors[:, :-1], factors[:, -1]


def pigment_gate(colors: np.ndarray, source: np.ndarray, reach: float = 1.0, protect: float = 0.0) -> np.ndarray:
    """Return how far colors, sRGB [n, 3], belong to the pigment of a source [3], lit or in shade: [n] in [0, 1].

    The gate is exp(-(dh / 0.65 reach)^4) of the Lab hue difference dh, reduced for pale sources. A gray source has no
    hue: its gate depends on the chroma difference. `protect` in [0, 1) excludes neutral colors (silver, foil, white
    paper) with a Lab saturation below this share of the source's, softly from half of it to 1.5 times.
    """
    lab, source = srgb_to_lab(colors), srgb_to_lab(np.asarray(source, np.float64))
    if lab_chroma(source) < GREY_CHROMA:
        return np.exp(-(((lab_chroma(lab) - lab_chroma(source)) / (reach * CHROMA_GATE)) ** 4))
    # the hue of pale paint varies with light and noise
    difference = hue_difference(lab, source) * (lab_chroma(source) / (lab_chroma(source) + PALE))
    gate = np.exp(-((difference / (reach * HUE_GATE)) ** 4))
    if protect:
        share = lab_saturation(lab) / lab_saturation(source)
        gate *= smooth_step(share, protect / 2, 3 * protect / 2)
    return gate


def hue_difference(lab: np.ndarray, source: np.ndarray) -> np.ndarray:
    """Return the hue of Lab colors [n, 3] minus that of a source [3], radians in [-pi, pi)."""
    return (lab_hue(lab) - lab_hue(source) + np.pi) % (2 * np.pi) - np.pi


def smooth_step(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Interpolate smoothly from 0 at `low` to 1 at `high`."""
    x = np.clip((values - low) / (high - low), 0, 1)
    return x * x * (3 - 2 * x)
