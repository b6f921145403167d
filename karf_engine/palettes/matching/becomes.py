"""Solve for swatches that turn one color of an object into another.

Each color of the object gets a target (`paints`), then a bounded fit finds the palette (`fitting`).

Arguments shared by the functions of this module:
    colors: The object's color histogram as currently edited, sRGB [n, 3] in [0, 1].
    counts: Frequency of each color, [n], >= 0.
    palette_weights: [n, M] over the M palette entries.
    palette: The current palette, sRGB [M, 3] in [0, MAX_SRGB]; entry 0 is black and never moves.
    locked: Further fixed entries.
    is_metal: Whether highlights take the paint's color rather than the light's.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from ...io.color import ciede2000, srgb_to_lab
from .fitting import apply_change, bounds, match_perceptually, match_pixels
from .paints import angles, is_black, paints_of, pigment_gate, reflection_target

OTHER_PAINT = 0.2  # angle in linear light, radians, between different paints; sun and open shade are 0.12 apart
AFFECTED = 0.1  # least gate of a paint that would change too
NEAR = 5.0  # Lab distance of similar colors of one paint
EMPHASIS = 1.0  # weight of the picked colors relative to the whole object


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
    """Return the palette [M, 3] float32 that turns the source's paint into the target's on the whole object.

    Shading and gloss are kept, other paints stay. The source is a current color of the object, sRGB [3] in [0, 1], or
    [P, 3] for several paints; the target, the wanted color, has the same shape. Raises BadRequest if a source is black.
    """
    source, target = add_preserved_paints(colors, counts, source, target, is_metal)
    targets = reflection_target(colors, source, target, is_metal)
    weights, colors, targets, counts = append_sources(
        colors, counts, palette_weights, targets, source, target, EMPHASIS
    )
    return match_perceptually(weights, colors, targets, palette, counts, locked)


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
    """Return the palette [M, 3] float32 after dragging a swatch to a color: the other swatches of its paint follow.

    The others are those of the best fit, in which the dragged swatch is free too: if they compensated for its distance from
    that fit, they would tint highlights. The result depends on the last color of a drag alone. A black swatch changes
    alone, as its paint is unknown.
    """
    start = np.array(palette, np.float32)
    start[index] = color
    source = np.clip(palette[index], 0, 1)
    if (start == palette).all() or is_black(source):
        return start
    targets = reflection_target(colors, source, start[index], is_metal)
    result = match_pixels(palette_weights, colors, targets, palette, counts, locked)
    result[index] = start[index]
    return result


def match_fewest(
    palette_weights_of_pixel: np.ndarray,
    palette: np.ndarray,
    target: np.ndarray,
    locked: Iterable[int] = (),
    shown: np.ndarray | None = None,
) -> np.ndarray:
    """Return the palette [M, 3] float32 that gives one pixel the target color while moving as few swatches as possible.

    Minimises the L2,1 norm of the swatches' moves, `sum_j |dP_j|` (as LoCoPalettes does), by iteratively reweighted least
    squares. `shown` is the pixel's current color, sRGB [3]; by default the palette's mixture.
    """
    weights = np.asarray(palette_weights_of_pixel, np.float64)
    lower, upper = bounds(palette, locked, np.maximum(1.0, palette))  # brighter than white may stay
    shown = weights @ np.asarray(palette, np.float64) if shown is None else shown
    wanted = np.clip(np.subtract(target, shown), weights @ lower, weights @ upper)
    penalty = np.ones(len(weights))
    for _ in range(40):
        direction = weights / penalty
        change = np.stack(
            [_scale_to(weights, direction, wanted[c], lower[:, c], upper[:, c]) for c in range(3)], axis=1
        )
        # the floor keeps unmoved swatches movable
        penalty = 1 / np.maximum(np.linalg.norm(change, axis=1), 1e-6)
    return apply_change(palette, change)


def residual_delta_e(
    before: np.ndarray,  # the object's colors when the source was picked, sRGB [n, 3] in [0, 1]
    after: np.ndarray,  # the same colors after the edit
    counts: np.ndarray,  # frequency of each color, [n]
    source: np.ndarray,  # the picked color, sRGB [3]
    target: np.ndarray,  # its wanted color
    held: Sequence[np.ndarray] = (),  # colors of other paints that should stay, sRGB [3] each
    is_metal: bool = False,
) -> float:
    """Return the mean CIEDE2000 between an edited object and its target, all paints and highlights included."""
    paints = add_preserved_paints(before, counts, *add_fixed_paints(before, source, target, held), is_metal)
    difference = ciede2000(srgb_to_lab(after), srgb_to_lab(reflection_target(before, *paints, is_metal)))
    return float(np.average(difference, weights=counts))


def add_fixed_paints(
    colors: np.ndarray, source: np.ndarray, target: np.ndarray, held: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return sources and targets [P, 3] of one changing paint and of the held ones that the object shows."""
    kept = [
        each
        for each in held
        if is_near(colors, each, or_nearest=False).any() and angles(source[None], each)[0] > OTHER_PAINT
    ]
    return np.stack([source, *kept]), np.stack([target, *kept])


def add_preserved_paints(
    colors: np.ndarray, counts: np.ndarray, source: np.ndarray, target: np.ndarray, is_metal: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Append a preserving pair to sources and targets, [3] or [P, 3], for each paint that the gate of a source affects.

    A metal has no paints: it shows reflections.
    """
    sources = np.atleast_2d(source)
    paints = np.empty((0, 3)) if is_metal else paints_of(colors, counts)
    is_affected = np.max([pigment_gate(paints, each) for each in sources], axis=0) > AFFECTED
    others = [each for each in paints[is_affected] if angles(sources, each).min() > OTHER_PAINT and not is_black(each)]
    return np.stack([*sources, *others]), np.stack([*np.atleast_2d(target), *others])


def nearest_weights(colors: np.ndarray, palette_weights: np.ndarray, color: np.ndarray) -> np.ndarray:
    """Return the palette weights [M] of the histogram color nearest in Lab to a color, sRGB [3]."""
    distance = np.linalg.norm(srgb_to_lab(colors) - srgb_to_lab(color), axis=1)
    return palette_weights[int(distance.argmin())]


def mean_weights(colors: np.ndarray, counts: np.ndarray, palette_weights: np.ndarray, color: np.ndarray) -> np.ndarray:
    """Return the mean palette weights [M] of the colors `is_near` a color, sRGB [3]."""
    nearby = is_near(colors, color)
    return np.average(palette_weights[nearby], axis=0, weights=np.maximum(counts[nearby], 1e-9))


def is_near(colors: np.ndarray, color: np.ndarray, or_nearest: bool = True) -> np.ndarray:
    """Return which colors, sRGB [n, 3], are within 5 of a color [3] in Lab; with `or_nearest`, at least the nearest."""
    distance = np.linalg.norm(srgb_to_lab(colors) - srgb_to_lab(color), axis=1)
    return distance <= (max(NEAR, distance.min()) if or_nearest else NEAR)


def append_sources(
    colors: np.ndarray,
    counts: np.ndarray,
    palette_weights: np.ndarray,
    targets: np.ndarray,
    source: np.ndarray,
    target: np.ndarray,
    emphasis: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Append the picked colors to palette weights, colors, targets and counts, with extra weight."""
    sources = np.atleast_2d(source)
    source_weights = [mean_weights(colors, counts, palette_weights, each) for each in sources]
    count = emphasis * max(np.sum(counts), 1e-9) / len(sources)  # counts may all be 0
    return (
        np.vstack([palette_weights, *source_weights]),
        np.vstack([colors, sources]),
        np.vstack([targets, target]),
        np.append(counts, [count] * len(sources)),
    )


def _scale_to(
    weights: np.ndarray, direction: np.ndarray, wanted: float, lower: np.ndarray, upper: np.ndarray
) -> np.ndarray:
    """Solve weights @ x = wanted for x = clip(m direction, lower, upper), [M], with a scalar m."""
    # weights @ x grows with m, and is linear while no entry reaches its bound
    movable = direction > 0
    breaks = np.concatenate([lower[movable] / direction[movable], upper[movable] / direction[movable], [0.0]])
    breaks = np.unique(breaks)
    reached = np.clip(breaks[:, None] * direction, lower, upper) @ weights
    multiplier = np.interp(wanted, reached, breaks)
    return np.clip(multiplier * direction, lower, upper)
