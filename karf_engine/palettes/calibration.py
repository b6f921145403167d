"""Color calibration: convert colors between the photos, their mean exposure, and a reference light.

A photo's gains of red, green and blue are factors of sRGB (`capture.View.gains`) from the mean exposure, that of
palettes and edits, so colors and changes of colors scale alike.

Color books give colors under daylight (D65); photos have the scene's light, exposure, white balance and filters. A
gray card determines one factor of linear light per channel (von Kries), a chart of 24 patches a full matrix. The chart
is the ColorChecker Classic as made since November 2014, by its published CIE L*a*b* (D50, 2 degree observer). Its four
corners are picked or detected (`commands.calibration`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..capture.capture import UNIT_GAINS
from ..errors import BadRequest
from ..io.color import ciede2000, lab_d50_to_d65, lab_to_srgb, linear_to_srgb, srgb_to_lab, srgb_to_linear
from .palette import MAX_SRGB

CARD_LIGHTNESS = 50.0  # L* of an 18 % gray card
DARKEST, CLIPPED = 0.02, 0.995  # range of usable sRGB values
# row by row from the upper left, with the gray row at the bottom
PATCHES = (
    ("dark skin", 37.54, 14.37, 14.92),
    ("light skin", 64.66, 19.27, 17.50),
    ("blue sky", 49.32, -3.82, -22.54),
    ("foliage", 43.46, -12.74, 22.72),
    ("blue flower", 54.94, 9.61, -24.79),
    ("bluish green", 70.48, -32.26, -0.37),
    ("orange", 62.73, 35.83, 56.50),
    ("purplish blue", 39.43, 10.75, -45.17),
    ("moderate red", 50.57, 48.64, 16.67),
    ("purple", 30.10, 22.54, -20.87),
    ("yellow green", 71.77, -24.13, 58.19),
    ("orange yellow", 71.51, 18.24, 67.37),
    ("blue", 28.37, 15.42, -49.80),
    ("green", 54.38, -39.72, 32.27),
    ("red", 42.43, 51.05, 28.62),
    ("yellow", 81.80, 2.67, 80.41),
    ("magenta", 50.63, 51.28, -14.12),
    ("cyan", 49.57, -29.71, -28.32),
    ("white", 95.19, -1.03, 2.93),
    ("neutral 8", 81.29, -0.57, 0.44),
    ("neutral 6.5", 66.89, -0.75, -0.06),
    ("neutral 5", 50.76, -0.13, 0.14),
    ("neutral 3.5", 35.63, -0.46, -0.48),
    ("black", 20.64, 0.07, -0.46),
)
ROWS, COLUMNS = 4, 6
PITCH, PATCH = 1.1, 1.0  # distance between patches, and their side
INNER, SAMPLES = 0.5, 24  # sampled share of a patch's side, as photos blur the borders, and points along it
MIN_PATCHES = 12  # usable ones
MAX_RESIDUAL = 10.0  # mean CIEDE2000 beyond which the picture is not a chart
MAX_CONDITION = 1e3  # of the matrix
EVEN = 0.1  # added to a patch's light when its error is weighted by 1 / light, so that dark patches do not dominate


def to_photo_exposure(colors: np.ndarray, gains: Sequence[float]) -> np.ndarray:
    """Convert colors, or changes of colors, from the mean exposure to that of a photo: float32 [..., 3], not clipped."""
    return np.asarray(colors, np.float32) * np.asarray(gains, np.float32)


def to_mean_exposure(colors: np.ndarray, gains: Sequence[float]) -> np.ndarray:
    """Convert colors of a photo, sRGB in [0, 1] or uint8, to the mean exposure: float32 [..., 3] in [0, 1].

    Gains of 1 return the array itself.
    """
    if tuple(gains) == UNIT_GAINS:
        return colors
    values = np.asarray(colors, np.float32) / (255 if np.asarray(colors).dtype == np.uint8 else 1)
    return np.clip(values / np.asarray(gains, np.float32), 0, 1).astype(np.float32)


@dataclass(frozen=True)
class ReferenceLight:
    """Difference between the reference light and the light and exposure of the photos."""

    matrix: np.ndarray  # [3, 3], from linear light under the reference to that of the photos; diagonal for a gray card

    @classmethod
    def of_card(cls, photographed: np.ndarray, lightness: float = CARD_LIGHTNESS) -> ReferenceLight:
        """Calibrate by the photographed color, sRGB [3], of a neutral card with this L*.

        Raises BadRequest if the card is too dark or clipped, or the lightness is out of range.
        """
        photographed = np.asarray(photographed, np.float64)
        if not 0 < lightness <= 100:
            raise BadRequest(f"A card cannot have the lightness {lightness!r}.", "Give its L*, over 0 up to 100.")
        if not ((photographed > DARKEST) & (photographed < CLIPPED)).all():
            raise BadRequest(
                "The gray card is too dark or too bright in the photo.", "Pick a spot where it is lit, and not clipped."
            )
        card = srgb_to_linear(np.clip(lab_to_srgb(np.array([lightness, 0, 0])), 0, 1))
        return cls(np.diag(srgb_to_linear(photographed) / card))

    def photographed(self, color: np.ndarray) -> np.ndarray:
        """Convert colors under the reference light, sRGB [..., 3] in [0, 1], to the photos, in [0, MAX_SRGB]."""
        return np.minimum(_transformed(self.matrix, color), MAX_SRGB)

    def reference(self, color: np.ndarray) -> np.ndarray:
        """Convert colors of the photos to the reference light, both sRGB [..., 3] in [0, MAX_SRGB]."""
        return np.minimum(_transformed(np.linalg.inv(self.matrix), color), MAX_SRGB)

    def lab_photographed(self, lab: np.ndarray) -> np.ndarray:
        """Convert colors under the reference light, CIE L*a*b* [..., 3], to the photos, without clipping."""
        return srgb_to_lab(_transformed(self.matrix, lab_to_srgb(lab)))

    def lab_reference(self, lab: np.ndarray) -> np.ndarray:
        """Invert `lab_photographed`."""
        return srgb_to_lab(_transformed(np.linalg.inv(self.matrix), lab_to_srgb(lab)))


def _transformed(matrix: np.ndarray, color: np.ndarray) -> np.ndarray:
    return linear_to_srgb(srgb_to_linear(color) @ matrix.T)


@dataclass(frozen=True)
class ChartFit:
    """Reference light fitted to a chart, with its residuals."""

    light: ReferenceLight
    residuals: np.ndarray  # [24], CIEDE2000 of each patch to its published color; NaN if clipped or dark

    @property
    def mean_residual(self) -> float:
        return float(np.nanmean(self.residuals))

    def __str__(self) -> str:
        worst = int(np.nanargmax(self.residuals))
        return (
            f"color chart: CIEDE2000 {self.mean_residual:.1f} left in the mean of "
            f"{np.isfinite(self.residuals).sum()} patches, {self.residuals[worst]:.1f} at most ({PATCHES[worst][0]})"
        )


def reference_colors() -> np.ndarray:
    """Return the patches under daylight (D65), sRGB [24, 3]; cyan is slightly out of gamut."""
    return lab_to_srgb(lab_d50_to_d65(np.array([lab for _, *lab in PATCHES])))


def _sample_points() -> np.ndarray:
    """Return the sample points of the patches, [24, n, 2]: (x, y) in the unit square of the chart."""
    rows, columns = np.divmod(np.arange(ROWS * COLUMNS), COLUMNS)
    centers = np.stack([columns, rows], -1) * PITCH + 0.5 * PATCH
    steps = (np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5
    within = INNER * PATCH * np.stack(np.meshgrid(steps, steps), -1).reshape(-1, 2)
    size = PITCH * np.array([COLUMNS - 1, ROWS - 1]) + PATCH
    return (centers[:, None] + within) / size


def _homography(corners: np.ndarray) -> np.ndarray:
    """Return the 3x3 matrix from the unit square to corners [4, 2], in the order (0, 0), (1, 0), (1, 1), (0, 1)."""
    rows = []
    for (x, y), (u, v) in zip(((0, 0), (1, 0), (1, 1), (0, 1)), corners, strict=True):
        rows += [[x, y, 1, 0, 0, 0, -u * x, -u * y], [0, 0, 0, x, y, 1, -v * x, -v * y]]
    return np.append(np.linalg.solve(np.array(rows), np.ravel(corners)), 1).reshape(3, 3)


def patch_colors(photo: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return the mean colors of the patches in a photo, sRGB [24, 3], averaged in linear light.

    The photo is sRGB [H, W, 3] in [0, 1]. Corners [4, 2] are pixels (u, v) from its upper left: the outer corners of
    the brown, bluish green, black and white patches, in this order. Raises BadRequest if they are not those of a chart,
    or outside the photo.
    """
    corners = np.asarray(corners, np.float64)
    edges = np.roll(corners, -1, axis=0) - corners
    following = np.roll(edges, -1, axis=0)
    turns = edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0]
    is_convex = (turns > 1).all() or (turns < -1).all()
    if not (is_convex and (corners >= 0).all() and (corners <= (photo.shape[1], photo.shape[0])).all()):
        raise BadRequest(
            "These four corners are not those of a color chart in the photo.",
            "Go round it from patch to patch: brown, bluish green, black, white.",
        )
    places = _sample_points()
    u, v, w = np.einsum("ij,npj->inp", _homography(corners), np.dstack([places, np.ones(places.shape[:2])]))
    columns, rows = (np.floor(each / w).astype(int) for each in (u, v))
    photographed = photo[np.clip(rows, 0, len(photo) - 1), np.clip(columns, 0, photo.shape[1] - 1), :3]
    return linear_to_srgb(srgb_to_linear(photographed).mean(axis=1))


def fit_chart(patches: np.ndarray) -> ChartFit:
    """Fit the reference light to the patches in the photos, sRGB [24, 3] in [0, 1], by least squares in linear light.

    Raises BadRequest if too many patches are clipped or dark, or they are not those of this chart.
    """
    known = reference_colors()
    counts = (patches.min(-1) > DARKEST) & (patches.max(-1) < CLIPPED)
    if counts.sum() < MIN_PATCHES:
        raise BadRequest(
            f"Only {counts.sum()} of the chart's {len(known)} patches are neither too dark nor too bright "
            "in the photo.",
            "Take a photo in which the chart is well lit.",
        )
    photographed, wanted = srgb_to_linear(patches[counts]), srgb_to_linear(known[counts])
    weights = 1 / (wanted.mean(-1, keepdims=True) + EVEN)
    to_reference = np.linalg.lstsq(photographed * weights, wanted * weights, rcond=None)[0].T
    left = np.full(len(known), np.nan)
    left[counts] = ciede2000(srgb_to_lab(linear_to_srgb(photographed @ to_reference.T)), srgb_to_lab(known[counts]))
    if left[counts].mean() > MAX_RESIDUAL or np.linalg.cond(to_reference) > MAX_CONDITION:
        raise BadRequest(
            f"This does not look like a color chart: CIEDE2000 {left[counts].mean():.0f} is left in the mean.",
            "Begin at the brown patch's corner, then bluish green, black and white.",
        )
    return ChartFit(ReferenceLight(np.linalg.inv(to_reference)), left)


def fit_photo(photo: np.ndarray, corners: np.ndarray) -> ChartFit:
    """Like `fit_chart` for a photo; the corners (see `patch_colors`) may start anywhere, in either direction."""
    corners, fits, refused = np.asarray(corners, np.float64), [], []
    for ordered in (corners, corners[::-1]):
        for begin in range(4):
            try:
                fits.append(fit_chart(patch_colors(photo, np.roll(ordered, begin, axis=0))))
            except BadRequest as error:
                refused.append(error)
    if not fits:
        raise refused[0]
    return min(fits, key=lambda fit: fit.mean_residual)
