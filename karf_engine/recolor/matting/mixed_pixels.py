"""Mixed pixels along a border: their coverage by closed-form matting, and their foreground colors.

Levin, Lischinski and Weiss, "A Closed-Form Solution to Natural Image Matting" (2008): if the colors of foreground and
background lie on a line in every window of 3 x 3 pixels, alpha is an affine function of color there. Minimizes
alpha^T L alpha with the matting Laplacian L, with known pixels fixed. L is built for the unknown pixels only.

Foreground colors are means of pure ones nearby, corrected by their share of the residual (Germer et al., "Fast
multi-level foreground estimation", 2020, without its smoothness term).
"""

from __future__ import annotations

import cv2
import numpy as np
from scipy import sparse

from ...compute.sparse_systems import solve
from ...io.color import linear_to_srgb, srgb_to_linear, to_bytes
from .matte import NEGLIGIBLE, NO_COLORS, NO_PIXELS, Matte, cropped
from .tiles import Tile, tiles, upsample_tile

REGULARIZATION = 1e-5  # epsilon of the paper, for colors in [0, 1]
GUESS_WEIGHT = 0.01  # of the guess in each pixel, for lines one pixel wide, which touch no known pixel
WINDOWS_AT_ONCE = 1 << 15  # 21 MB of window matrices
WINDOW = [(row, column) for row in (-1, 0, 1) for column in (-1, 0, 1)]

WINDOWS = (1.5, 4.0, 12.0)  # pixels: standard deviations of the windows searched for pure colors, in this order
MIN_PURE = 1e-3  # share of a window
TILE, MARGIN = 1024, 32

LINEAR = srgb_to_linear(np.arange(256) / 255).astype(np.float32)


def closed_form_matting(
    colors: np.ndarray,  # [h, w, 3] float32 in [0, 1], linear light
    coverage: np.ndarray,  # [h, w] float32 in [0, 1]; a guess in unknown pixels
    unknown: np.ndarray,  # [h, w] bool; pixels on the image border count as known
) -> np.ndarray:
    """Solve for the coverage of the n unknown pixels, float32 [n] in [0, 1]."""
    inner = np.zeros_like(unknown)
    inner[1:-1, 1:-1] = True
    result = coverage[unknown].astype(np.float32)
    wanted = unknown & inner
    if not wanted.any():
        return result
    system, right_hand_side = _system(colors, coverage, wanted)
    system += GUESS_WEIGHT * sparse.eye_array(len(right_hand_side))
    right_hand_side += GUESS_WEIGHT * coverage[wanted]
    solved = solve(system, right_hand_side, coverage[wanted].astype(np.float64))
    result[inner[unknown]] = np.clip(solved, 0, 1)
    return result


def _system(colors: np.ndarray, coverage: np.ndarray, wanted: np.ndarray) -> tuple[sparse.csr_array, np.ndarray]:
    """Return the rows and columns of L of the wanted pixels, and the right-hand side from known neighbors."""
    count, width = int(wanted.sum()), wanted.shape[1]
    number = np.full(wanted.size, -1, np.int32)
    number[wanted.ravel()] = np.arange(count, dtype=np.int32)
    steps = np.array([row * width + column for row, column in WINDOW])
    centers = _centers(wanted)
    flat_colors, known = colors.reshape(-1, 3), coverage.ravel()
    right_hand_side = np.zeros(count)
    system = sparse.csr_array((count, count))
    for first in range(0, len(centers), WINDOWS_AT_ONCE):
        pixels = centers[first : first + WINDOWS_AT_ONCE, None] + steps
        laplacians = _window_laplacians(flat_colors[pixels].astype(np.float64))
        own, other = np.broadcast_arrays(number[pixels][:, :, None], number[pixels][:, None, :])
        both, edge = (own >= 0) & (other >= 0), (own >= 0) & (other < 0)
        system += sparse.csr_array((laplacians[both], (own[both], other[both])), (count, count))
        beside = np.broadcast_to(known[pixels][:, None, :], laplacians.shape)[edge]
        right_hand_side -= np.bincount(own[edge], laplacians[edge] * beside, count)
    return system, right_hand_side


def _centers(wanted: np.ndarray) -> np.ndarray:
    """Return the flat indices of pixels whose window is inside the picture and contains a wanted pixel."""
    near = np.zeros_like(wanted)
    for row, column in WINDOW:
        near[1:-1, 1:-1] |= wanted[1 + row : wanted.shape[0] - 1 + row, 1 + column : wanted.shape[1] - 1 + column]
    return np.flatnonzero(near)


def _window_laplacians(colors: np.ndarray) -> np.ndarray:
    """Return the terms of L of n windows of colors [n, 9, 3], [n, 9, 9] (Eq. 12 of the paper)."""
    size = len(WINDOW)
    centered = colors - colors.mean(1, keepdims=True)
    covariances = centered.transpose(0, 2, 1) @ centered / size + REGULARIZATION / size * np.eye(3)
    affinities = (1 + centered @ np.linalg.solve(covariances, centered.transpose(0, 2, 1))) / size
    return np.eye(size) - affinities


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
    """Return (row, column) in the tile [n, 2] of its mixed pixels, and their foreground colors uint8 [n, 3]."""
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
