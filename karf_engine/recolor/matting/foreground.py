"""Foreground colors of mixed pixels."""

from __future__ import annotations

import cv2
import numpy as np

from ...io.color import linear_to_srgb, srgb_to_linear, to_bytes
from .matte import NEGLIGIBLE, Matte
from .tiles import Tile, enlarged, tiles

WINDOWS = (1.5, 4.0, 12.0)  # pixels: standard deviations of the windows searched for pure colors, in this order
MIN_PURE = 1e-3  # share of a window
TILE, MARGIN = 1024, 32

LINEAR = srgb_to_linear(np.arange(256) / 255).astype(np.float32)


def unmixed(photo: np.ndarray, coverage: np.ndarray) -> list[Matte]:
    """Make mattes of K objects from their coverage.

    Args:
        photo: uint8 [H, W, 3] sRGB.
        coverage: [K, h, w] in [0, 1], at the photo's size or a smaller one.
    """
    n_objects, (height, width) = len(coverage), photo.shape[:2]
    result = np.zeros((n_objects, height, width), np.float16)
    mixed: list[list[np.ndarray]] = [[] for _ in range(n_objects)]
    colors: list[list[np.ndarray]] = [[] for _ in range(n_objects)]
    for tile in tiles((height, width), TILE, MARGIN):
        covered = enlarged(coverage, (height, width), tile)
        if covered.max(initial=0) <= NEGLIGIBLE:
            continue
        result[(slice(None), *tile.place)] = covered[(slice(None), *tile.inner)]
        light = LINEAR[photo[tile.outer]]
        for k, own in enumerate(covered):
            places, unmixed_colors = _own_colors(light, own, tile)
            mixed[k].append(places[:, 0] * width + places[:, 1])
            colors[k].append(unmixed_colors)
    parts = zip(result, mixed, colors, strict=True)
    return [_cropped(own, _joined(places, ()), _joined(found, (3,))) for own, places, found in parts]


def _own_colors(light: np.ndarray, coverage: np.ndarray, tile: Tile) -> tuple[np.ndarray, np.ndarray]:
    """Return (row, column) in the photo [n, 2] of a tile's mixed pixels, and their foreground colors uint8 [n, 3].

    Means of pure foreground and background colors nearby, corrected by their shares of the residual (Germer et al.,
    "Fast multi-level foreground estimation", 2020, without its smoothness term).
    """
    chosen = np.zeros(coverage.shape, bool)
    chosen[tile.inner] = ((coverage > NEGLIGIBLE) & (coverage < 1 - NEGLIGIBLE))[tile.inner]
    places = np.argwhere(chosen)
    if not len(places):
        return places, np.zeros((0, 3), np.uint8)
    here, share = light[chosen], coverage[chosen][:, None]
    own, own_known = _color_nearby(light, coverage >= 1 - NEGLIGIBLE, chosen)
    behind, behind_known = _color_nearby(light, coverage <= NEGLIGIBLE, chosen)
    behind[~behind_known] = here[~behind_known]
    residual = here - share * own - (1 - share) * behind
    own += share * residual / (share**2 + (1 - share) ** 2)
    own[~own_known] = here[~own_known]
    return places + [tile.rows.start, tile.columns.start], to_bytes(linear_to_srgb(np.clip(own, 0, 1)))


def _color_nearby(light: np.ndarray, pure: np.ndarray, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return mean colors [n, 3] of pure pixels around the chosen ones, in the smallest window with some; and bool [n]."""
    result, known = np.zeros((int(chosen.sum()), 3), np.float32), np.zeros(int(chosen.sum()), bool)
    weighted = np.concatenate([light * pure[..., None], pure[..., None]], -1, dtype=np.float32)
    for deviation in WINDOWS:
        if known.all():
            break
        means = cv2.GaussianBlur(weighted, (0, 0), deviation)[chosen]
        found = ~known & (means[:, 3] > MIN_PURE)
        result[found] = means[found, :3] / means[found, 3:]
        known |= found
    return result, known


def _joined(parts: list[np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    return np.concatenate(parts) if parts else np.zeros((0, *shape), np.int64)


def _cropped(coverage: np.ndarray, mixed: np.ndarray, colors: np.ndarray) -> Matte:
    """Crop a whole photo's coverage [H, W] to a matte. mixed: flat indices [n] in the photo."""
    seen = coverage > NEGLIGIBLE
    rows, columns = np.flatnonzero(seen.any(1)), np.flatnonzero(seen.any(0))
    if not len(rows):
        return Matte((0, 0), (0, 0), np.zeros((0, 0), np.float16), np.zeros(0, np.int64), np.zeros((0, 3), np.uint8))
    top, bottom, left, right = int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1
    row, column = np.divmod(mixed, coverage.shape[1])
    numbers = (row - top) * (right - left) + column - left
    order = np.argsort(numbers)
    return Matte((top, bottom), (left, right), coverage[top:bottom, left:right].copy(), numbers[order], colors[order])
