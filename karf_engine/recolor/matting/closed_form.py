"""Closed-form matting of the pixels along a border.

Levin, Lischinski and Weiss, "A Closed-Form Solution to Natural Image Matting" (2008): if the colors of foreground and
background lie on a line in every window of 3 x 3 pixels, alpha is an affine function of color there. Minimizes
alpha^T L alpha with the matting Laplacian L, with known pixels fixed. L is built for the unknown pixels only.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from ...compute.sparse_systems import solve

REGULARIZATION = 1e-5  # epsilon of the paper, for colors in [0, 1]
GUESS_WEIGHT = 0.01  # of the guess in each pixel, for lines one pixel wide, which touch no known pixel
WINDOWS_AT_ONCE = 1 << 15  # 21 MB of window matrices
WINDOW = [(row, column) for row in (-1, 0, 1) for column in (-1, 0, 1)]


def closed_form_matting(colors: np.ndarray, coverage: np.ndarray, unknown: np.ndarray) -> np.ndarray:
    """Solve for the coverage of the n unknown pixels, float32 [n] in [0, 1].

    Args:
        colors: [h, w, 3] float32 in [0, 1], linear light.
        coverage: [h, w] float32 in [0, 1]; a guess in unknown pixels.
        unknown: [h, w] bool; pixels on the image border count as known.
    """
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
