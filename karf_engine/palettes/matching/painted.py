"""Swatches that make a view look as it was painted over or graded: a robust, bounded fit to the picture's own pixels.

Naming as in `compositing`: K objects, M palette entries, H x W pixels; n are the pixels of one object.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...errors import BadRequest
from ...io.color import ciede2000, srgb_to_lab
from ..compositing import hard_masks
from ..palette import BRIGHTEST, Palette
from .fitting import bounds, moved
from .least_squares import bounded_least_squares

DIFFERENT = 4 / 255  # in one channel: such a pixel was painted; less can be a file's rounding or noise
ENOUGH = 0.002  # share of an object's pixels that must be painted for the object to be fitted
UNPAINTED = 0.1  # weight of all unpainted pixels of an object together, as a share of the painted ones'
OUTLIER = 0.1  # distance in sRGB to what swatches can reach at which a pixel counts a quarter
SPILL = 0.4  # share of the strongest object's change that one needs where a fit to parts of it worsens the whole
RIDGE = 1e-3  # ridge per unit of counts, which keeps swatches still that hardly any pixel uses
ROUNDS = 10  # rounds of reweighting; later ones move no color by a step of 8 bits
MOST_PIXELS = 20_000  # pixels of an object that are sampled, evenly over it: more of them add nothing


@dataclass(frozen=True)
class ObjectMatch:
    """What came of one object.

    Attributes:
        name: The object's.
        colors: Its palette now, [M, 3] float32 in [0, BRIGHTEST].
        before: Mean CIEDE2000 of its pixels to the wanted picture, as they were.
        left: The same after the match.
        painted: The share of its pixels that were wanted otherwise, 0..1.
    """

    name: str
    colors: np.ndarray
    before: float
    left: float
    painted: float

    @property
    def strength(self) -> float:
        """Mean CIEDE2000 of what is painted to what was there."""
        return self.before / self.painted


def match_picture(
    palette_weights: np.ndarray,
    probabilities: np.ndarray,
    base: np.ndarray,
    wanted: np.ndarray,
    palettes: Sequence[Palette],
    edited: Mapping[str, np.ndarray],
    locked: Mapping[str, Iterable[int]] | None = None,
) -> tuple[ObjectMatch, ...]:
    """The palettes with which a view comes closest to a wanted picture of it.

    Only differences between the wanted picture and the edited view count: objects that it leaves alone stay, and
    the unpainted pixels of others count little, and nothing where they contradict the painted ones. Objects that only
    reflect the new colors of others, faintly and in parts, stay too.

    Args:
        palette_weights: [K, M, H, W].
        probabilities: [K, H, W], of the objects.
        base: The view without any edit, [H, W, 3] in [0, 1].
        wanted: The same view as it should look, [H, W, 3] in [0, 1].
        palettes: As learned, of the K objects.
        edited: The palettes as they stand, by the objects' names.
        locked: Swatches of objects that stay as they stand.

    Returns:
        One for each object that the view shows and that is wanted otherwise; none where there is no such object.

    Raises:
        BadRequest: The picture has another size than the view.

    Examples:
        Of a pot in two pixels one is painted over:

        >>> weights = np.array([[[[0.0, 0.5]], [[1.0, 0.5]]]])  # lit, and half in the shade
        >>> pot = Palette("pot", np.array([[0, 0, 0], [0.8, 0.2, 0]], np.float32))
        >>> base = np.array([[[0.8, 0.2, 0], [0.4, 0.1, 0]]])
        >>> wanted = np.array([[[0, 0.2, 0.8], [0.4, 0.1, 0]]])
        >>> (match,) = match_picture(weights, np.ones((1, 1, 2)), base, wanted, [pot], {"pot": pot.colors})
        >>> print(match.colors.round(1), round(match.painted, 1))
        [[0.  0.  0. ]
         [0.  0.2 0.8]] 0.5
    """
    if wanted.shape != base.shape:
        raise BadRequest(
            f"The picture has {wanted.shape[1]} x {wanted.shape[0]} pixels, the view {base.shape[1]} x {base.shape[0]}.",
            "Take a picture of this view.",
        )
    masks, found = hard_masks(np.asarray(probabilities, np.float32)), []
    for number, palette in enumerate(palettes):
        pixels = _spread(np.flatnonzero(masks[number]))
        shown = base.reshape(-1, 3)[pixels].astype(np.float64)
        for other, planes in zip(palettes, palette_weights, strict=True):
            change = edited[other.name] - other.colors
            if change.any():
                shown += _weights_at(planes, pixels, len(change)) @ change
        aim = wanted.reshape(-1, 3)[pixels].astype(np.float64)
        painted = (np.abs(aim - np.clip(shown, 0, 1)) > DIFFERENT).any(axis=1)
        if painted.sum() > ENOUGH * len(pixels):
            weights = _weights_at(palette_weights[number], pixels, len(palette.colors))
            stays = (locked or {}).get(palette.name, ())
            colors = _fit(weights, shown, aim, painted, edited[palette.name], stays)
            reached = shown + weights @ (colors - edited[palette.name])
            sides = (_difference(picture, aim) for picture in (shown, reached))
            found.append(ObjectMatch(palette.name, colors, *sides, float(painted.mean())))
    strongest = max((match.strength for match in found), default=0.0)
    return tuple(match for match in found if match.left < match.before or match.strength >= SPILL * strongest)


def _spread(pixels: np.ndarray) -> np.ndarray:
    """At most MOST_PIXELS of them, evenly."""
    return pixels[np.linspace(0, len(pixels) - 1, min(len(pixels), MOST_PIXELS)).astype(np.intp)]


def _weights_at(planes: np.ndarray, pixels: np.ndarray, size: int) -> np.ndarray:
    """Weights [n, size] of an object's planes [M, H, W]; small palettes have fewer entries than planes."""
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
    """The palette [M, 3] that takes pixels from what is shown to the aim, by iteratively reweighted least squares.

    The weights are those of Geman and McClure (1987), "Statistical methods for tomographic image reconstruction", by
    which what no palette can explain, such as a stray brush stroke, loses its weight.

    Args:
        weights: Of the pixels, [n, M].
        shown: What the palette gives, not clipped, [n, 3].
        aim: sRGB [n, 3] in [0, 1].
        painted: Which pixels are wanted otherwise, bool [n], at least one.
        palette: As it stands, [M, 3].
        locked: Entries that stay.
    """
    lower, upper = bounds(palette, locked, BRIGHTEST)
    counts = np.where(painted, 1.0, UNPAINTED * painted.sum() / max(1, (~painted).sum()))
    sure = painted & (aim > 0).all(axis=1) & (aim < 1).all(axis=1)
    trust, reached = (sure if sure.any() else painted).astype(np.float64), shown
    for _ in range(ROUNDS):
        # what is clipped in the picture is met by all that is clipped
        met = (aim >= 1) & (reached > 1) | (aim <= 0) & (reached < 0)
        wanted = np.where(met, reached, aim)
        change = bounded_least_squares(weights, wanted - shown, lower, upper, counts * trust, RIDGE)
        reached = shown + weights @ change
        miss = np.linalg.norm(np.clip(reached, 0, 1) - aim, axis=1)
        trust = 1 / (1 + (miss / OUTLIER) ** 2) ** 2
    return moved(palette, change)
