"""Swatches that make one color become another: a target for every color of the object, then a bounded fit.

Naming: n colors of an object (histogram cells or pixels), [n, 3] sRGB in [0, 1], with counts [n]. palette_weights
[n, M]: each color's share of the M palette entries; a palette change dP [M, 3] moves the colors by
palette_weights @ dP. Entry 0 is black and never moves; `locked` lists further entries that stay. The solver is
hand-written because swatches are matched inside Blender, which has numpy alone.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ..color import lab_chroma, lab_hue, linear_to_srgb, srgb_to_lab, srgb_to_linear
from ..errors import BadRequest, DataError
from ..npz import read_arrays
from .palette import BRIGHTEST

AGAIN = "Extract the palettes again."
MOST_CELLS = 2**18  # of a histogram of colors
HUE_GATE = 0.65  # radians of Lab hue at which a color counts as another pigment
GREY_CHROMA, CHROMA_GATE = 6.0, 25.0  # Lab chroma below which a source has no hue; and the gate that then stands in
STILL = 1e-4  # a move of a swatch under this, 1/40 of a step of 8 bits, is rounding
RIDGE = 1e-3  # per unit of counts: what keeps swatches still that hardly any pixel uses


def read_object_colors(path: Path, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """An object's color histogram as the palette stage wrote it: colors [n, 3], counts [n], palette_weights [n, M].

    Raises DataError where the file is unreadable, has nothing of this object, or values that cannot be.
    """
    parts = [f"{name}/{part}" for part in ("colors", "counts", "palette_weights")]
    colors, counts, weights = read_arrays(path, parts, f"colors of {name!r}", AGAIN)
    fits = counts.ndim == 1 and colors.shape == (len(counts), 3) and weights.shape[:-1] == counts.shape
    is_sane = all(array.dtype.kind in "iuf" and np.isfinite(array).all() for array in (colors, counts, weights))
    if not (fits and is_sane and 0 < len(counts) <= MOST_CELLS and counts.min() >= 0 and counts.sum() > 0):
        raise DataError(
            f"{path} has colors {colors.shape}, counts {counts.shape} and weights {weights.shape} of {name!r}, "
            "which are no histogram.",
            AGAIN,
        )
    return colors, counts, weights


def reflection_target(colors: np.ndarray, source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """What each color becomes when the paint that looks like `source` is changed to look like `target`.

    Linear light c = a r + s (1, 1, 1) + rest with the source r; shading a and gloss s are not negative, found by least
    squares. The paint's part follows: c + gate a (t - r); gate = exp(-(dh / 0.65)^4) of the Lab hue difference dh to
    the source leaves other pigments alone. A grey source has no hue: there the chroma difference gates.

    colors: [n, 3]. source, target: [3]; what an eyedropper shows before and after. All sRGB in [0, 1].
    Returns [n, 3] float64 in [0, 1]. Raises BadRequest for a black source, which tells nothing about shading.
    """
    source = np.asarray(source, np.float64)
    light, r, t = srgb_to_linear(colors), srgb_to_linear(source), srgb_to_linear(target)
    if r @ r < 1e-6:
        raise BadRequest("The source color is black, so its shading cannot be told.", "Pick a lit spot of the object.")
    shading = _shading(light, r)
    gate = _pigment_gate(srgb_to_lab(colors), srgb_to_lab(source))
    return np.clip(linear_to_srgb(light + (gate * shading)[:, None] * (t - r)), 0, 1)


def _shading(light: np.ndarray, r: np.ndarray) -> np.ndarray:
    """The factor a >= 0 [n] of light = a r + s (1, 1, 1) + rest, s >= 0, by least squares."""
    rr, r1, cr, c1 = r @ r, r.sum(), light @ r, light.sum(axis=1)
    paint_only = np.maximum(cr / rr, 0)
    determinant = 3 * rr - r1 * r1
    if determinant < 1e-3 * rr:  # gloss and paint are both grey: nothing tells them apart
        return paint_only
    paint, gloss = (3 * cr - r1 * c1) / determinant, (rr * c1 - r1 * cr) / determinant
    return np.where(gloss < 0, paint_only, np.maximum(paint, 0))


def _pigment_gate(lab: np.ndarray, source: np.ndarray) -> np.ndarray:
    """1 for colors of the source's pigment, 0 for others, [n]."""
    if lab_chroma(source) < GREY_CHROMA:
        return np.exp(-(((lab_chroma(lab) - lab_chroma(source)) / CHROMA_GATE) ** 4))
    turn = (lab_hue(lab) - lab_hue(source) + np.pi) % (2 * np.pi) - np.pi
    return np.exp(-((turn / HUE_GATE) ** 4))


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

    colors [n, 3] with counts [n] and palette_weights [n, M]: the object's color histogram. palette: [M, 3] as learned.
    Returns the edited palette [M, 3] float32 in [0, BRIGHTEST]. Raises BadRequest for a black source.
    """
    targets = reflection_target(colors, source, target)
    return match_pixels(palette_weights, colors, targets, palette, counts, locked)


def match_pixels(
    palette_weights: np.ndarray,
    colors: np.ndarray,
    targets: np.ndarray,
    palette: np.ndarray,
    counts: np.ndarray | None = None,
    locked: Iterable[int] = (),
) -> np.ndarray:
    """The palette that moves n colors closest to n targets, by bounded least squares in sRGB: "match a painted view".

    A hull encloses the colors, so its entries lie near the rim of [0, 1] and brighter paint needs some beyond white;
    the pixels themselves are clipped when they are composed.

    palette_weights: [n, M]. colors, targets: [n, 3] in [0, 1]. palette: [M, 3]. counts: [n], default 1 each.
    Returns the edited palette [M, 3] float32 in [0, BRIGHTEST]; entry 0 and locked ones are the palette's own.
    """
    lower, upper = _room(palette, locked, BRIGHTEST)
    change = bounded_least_squares(palette_weights, np.subtract(targets, colors), lower, upper, counts, RIDGE)
    return _moved(palette, change)


def match_fewest(
    palette_weights_of_pixel: np.ndarray,
    palette: np.ndarray,
    target: np.ndarray,
    locked: Iterable[int] = (),
    shown: np.ndarray | None = None,
) -> np.ndarray:
    """The palette that gives one pixel the target color and touches as few swatches as it can.

    Minimises the sum of the swatches' moves `|dP_j|` (an L2,1 norm; the rule of LoCoPalettes) by iteratively reweighted
    least squares, each step solved exactly within 0 <= P + dP <= 1. A target out of reach is met as closely as the box
    lets it, channel by channel.

    palette_weights_of_pixel: [M]. palette: [M, 3]. target: [3]. shown: [3] the pixel's color now (default: what the
    palette gives). Returns the edited palette [M, 3] float32.
    """
    weights = np.asarray(palette_weights_of_pixel, np.float64)
    lower, upper = _room(palette, locked, 1.0)
    shown = weights @ np.asarray(palette, np.float64) if shown is None else shown
    wanted = np.clip(np.subtract(target, shown), weights @ lower, weights @ upper)
    stiffness = np.ones(len(weights))
    for _ in range(40):
        pull = weights / stiffness
        change = np.stack([_shared_pull(weights, pull, wanted[c], lower[:, c], upper[:, c]) for c in range(3)], axis=1)
        # the floor keeps a still swatch movable; 1e-6 is far under a step of 8 bits
        stiffness = 1 / np.maximum(np.linalg.norm(change, axis=1), 1e-6)
    return _moved(palette, change)


def nearest_weights(colors: np.ndarray, palette_weights: np.ndarray, color: np.ndarray) -> np.ndarray:
    """Palette weights [M] of the histogram color nearest in Lab to an eyedropper's sRGB color [3]."""
    distance = np.linalg.norm(srgb_to_lab(colors) - srgb_to_lab(color), axis=1)
    return palette_weights[int(distance.argmin())]


def bounded_least_squares(
    matrix: np.ndarray,
    values: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    counts: np.ndarray | None = None,
    ridge: float = 0.0,
) -> np.ndarray:
    """Minimise `sum_i counts_i |matrix_i x - values_i|^2 + ridge sum(counts) |x|^2`, lower <= x <= upper, exactly.

    matrix: [n, M]. values: [n, C]; the columns are solved apart. lower, upper: [M, C] with lower <= 0 <= upper; equal
    bounds pin an entry. counts: [n] >= 0, default 1 each. Returns x [M, C].

    An active-set method: finite, and at its end the gradient vanishes on free entries and presses bound ones outward.
    """
    matrix, values = np.asarray(matrix, np.float64), np.asarray(values, np.float64)
    counts = np.ones(len(matrix)) if counts is None else np.asarray(counts, np.float64)
    counts = counts / counts.sum()
    weighted = matrix * counts[:, None]
    # a trace of ridge makes the problem strictly convex, so that every subset of entries can be solved
    normal = weighted.T @ matrix + max(ridge, 1e-12) * np.eye(matrix.shape[1])
    right = weighted.T @ values
    columns = [_active_set(normal, right[:, c], lower[:, c], upper[:, c]) for c in range(values.shape[1])]
    return np.stack(columns, axis=1)


def _active_set(normal: np.ndarray, right: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Minimise x normal x / 2 - right x in the box, from x = 0; normal [M, M] positive definite."""
    x = np.zeros(len(right))
    free = lower < upper
    for _ in range(20 * len(right)):  # each stay of the free set lowers the objective: no set comes back
        best = x.copy()
        if free.any():
            fixed = right[free] - normal[np.ix_(free, ~free)] @ x[~free]
            best[free] = np.linalg.solve(normal[np.ix_(free, free)], fixed)
        step = best - x
        limit = np.where(step > 0, upper, lower)
        room = np.divide(limit - x, step, out=np.full_like(x, np.inf), where=free & (step != 0))
        blocking = int(room.argmin())
        if room[blocking] < 1:
            x = x + room[blocking] * step
            x[blocking] = limit[blocking]
            free[blocking] = False
            continue
        x = best
        downhill = right - normal @ x
        inward = np.where(x >= upper, -downhill, downhill)
        inward[free | (lower == upper)] = 0
        release = int(inward.argmax())
        if inward[release] <= 1e-10:
            return x
        free[release] = True
    return x


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


def _room(palette: np.ndarray, locked: Iterable[int], brightest: float) -> tuple[np.ndarray, np.ndarray]:
    """Bounds [M, 3] of a palette change: 0 <= palette + change <= brightest; entry 0 and locked ones stay."""
    palette = np.asarray(palette, np.float64)
    lower, upper = -palette, brightest - palette
    pinned = [0, *locked]
    lower[pinned] = upper[pinned] = 0
    return lower, upper


def _moved(palette: np.ndarray, change: np.ndarray) -> np.ndarray:
    """The palette after the change; swatches that nobody could see moving keep their bits."""
    palette = np.asarray(palette, np.float32)
    still = np.abs(change).max(axis=1, keepdims=True) < STILL
    return np.where(still, palette, np.clip(palette + change, 0, BRIGHTEST)).astype(np.float32)
