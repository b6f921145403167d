"""Foreground colors of mixed pixels."""

from __future__ import annotations

import cv2
import numpy as np

from ...io.color import linear_to_srgb, srgb_to_linear, to_bytes
from .matte import NEGLIGIBLE, NO_COLORS, NO_PIXELS, Matte, cropped
from .tiles import Tile, tiles, upsample_tile

WINDOWS = (1.5, 4.0, 12.0)  # pixels: standard deviations of the windows searched for pure colors, in this order
MIN_PURE = 1e-3  # share of a window
TILE, MARGIN = 1024, 32

LINEAR = srgb_to_linear(np.arange(256) / 255).astype(np.float32)


def unmix(photo: np.ndarray, coverage: np.ndarray) -> list[Matte]:
    """Make mattes of K objects in a photo, uint8 [H, W, 3], from coverage [K, h, w] of its size or a smaller one."""
    n_objects, (height, width) = len(coverage), photo.shape[:2]
    result = np.zeros((n_objects, height, width), np.float16)
    mixed, colors = [[NO_PIXELS] for _ in range(n_objects)], [[NO_COLORS] for _ in range(n_objects)]
    for tile in tiles((height, width), TILE, MARGIN):
        covered = upsample_tile(coverage, (height, width), tile)
        if covered.max(initial=0) <= NEGLIGIBLE:
            continue
        result[(slice(None), *tile.place)] = covered[(slice(None), *tile.inner)]
        light = LINEAR[photo[tile.outer]]
        for k, own in enumerate(covered):
            pixels, own_colors = _own_colors(light, own, tile)
            mixed[k].append((pixels[:, 0] + tile.rows.start) * width + pixels[:, 1] + tile.columns.start)
            colors[k].append(own_colors)
    parts = zip(result, mixed, colors, strict=True)
    return [cropped(own, np.float16, np.concatenate(pixels), np.concatenate(found)) for own, pixels, found in parts]


def _own_colors(light: np.ndarray, coverage: np.ndarray, tile: Tile) -> tuple[np.ndarray, np.ndarray]:
    """Return (row, column) in the tile [n, 2] of its mixed pixels, and their foreground colors uint8 [n, 3].

    Means of pure foreground and background colors nearby, corrected by their shares of the residual (Germer et al.,
    "Fast multi-level foreground estimation", 2020, without its smoothness term).
    """
    chosen = np.zeros(coverage.shape, bool)
    chosen[tile.inner] = ((coverage > NEGLIGIBLE) & (coverage < 1 - NEGLIGIBLE))[tile.inner]
    pixels = np.argwhere(chosen)
    if not len(pixels):
        return pixels, NO_COLORS
    here, share = light[chosen], coverage[chosen][:, None]
    own, own_known = _color_nearby(light, coverage >= 1 - NEGLIGIBLE, chosen)
    behind, behind_known = _color_nearby(light, coverage <= NEGLIGIBLE, chosen)
    behind[~behind_known] = here[~behind_known]
    residual = here - share * own - (1 - share) * behind
    own += share * residual / (share**2 + (1 - share) ** 2)
    own[~own_known] = here[~own_known]
    return pixels, to_bytes(linear_to_srgb(np.clip(own, 0, 1)))


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
