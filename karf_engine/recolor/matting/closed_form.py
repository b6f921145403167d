"""Coverage of the few pixels along a border, by closed-form matting.

Levin, Lischinski and Weiss, "A Closed-Form Solution to Natural Image Matting" (2008): where foreground and background
each vary little (along a line of colors) in every window of 3 x 3 pixels, coverage is an affine function of color
there. The cost of leaving that is alpha^T L alpha with their matting Laplacian L; known pixels hold their values.

Written here because the library that has it, PyMatting, needs LLVM, compiles for most of a minute at its first import,
and builds L for whole pictures; a border needs a thin band of it.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from ...compute.sparse_systems import solve

REGULARIZATION = 1e-5  # epsilon of the paper, for colors in [0, 1]: noise says nothing about coverage (not varied)
GUESS = (
    0.01  # weight of the guess in each pixel, for lines one pixel wide, which touch no certain pixel (on such lines)
)
WINDOWS_AT_ONCE = 1 << 15  # 21 MB of window matrices
WINDOW = [(row, column) for row in (-1, 0, 1) for column in (-1, 0, 1)]


def closed_form_matting(colors: np.ndarray, coverage: np.ndarray, unknown: np.ndarray) -> np.ndarray:
    """Coverage of the unknown pixels; the others keep theirs.

    Args:
        colors: [h, w, 3] float32 in [0, 1], in linear light, for that is what a lens mixes.
        coverage: [h, w] float32 in [0, 1]; of unknown pixels a guess.
        unknown: [h, w] bool; pixels at the picture's rim are taken as known.

    Returns:
        [n] float32 in [0, 1] of the n unknown pixels.

    Examples:
        Between a black and a white pixel the grey one is covered by half:

        >>> ramp = np.repeat(np.array([[0, 0, 0.5, 1, 1]], np.float32), 3, 0)
        >>> unknown = np.zeros((3, 5), bool)
        >>> unknown[1, 2] = True
        >>> guess = np.where(unknown, 0, ramp)
        >>> closed_form_matting(np.stack([ramp] * 3, -1), guess, unknown).round(2).tolist()
        [0.5]
    """
    inner = np.zeros_like(unknown)
    inner[1:-1, 1:-1] = True
    result = coverage[unknown].astype(np.float32)
    asked = unknown & inner
    if not asked.any():
        return result
    system, right_hand_side = _system(colors, coverage, asked)
    system += GUESS * sparse.eye_array(len(right_hand_side))
    right_hand_side += GUESS * coverage[asked]
    solved = solve(system, right_hand_side, coverage[asked].astype(np.float64))
    result[inner[unknown]] = np.clip(solved, 0, 1)
    return result


def _system(colors: np.ndarray, coverage: np.ndarray, asked: np.ndarray) -> tuple[sparse.csr_array, np.ndarray]:
    """Rows and columns of L of the pixels asked for, and what known pixels beside them add to the right-hand side."""
    count, width = int(asked.sum()), asked.shape[1]
    number = np.full(asked.size, -1, np.int32)
    number[asked.ravel()] = np.arange(count, dtype=np.int32)
    steps = np.array([row * width + column for row, column in WINDOW])
    centers = _centers(asked)
    flat_colors, known = colors.reshape(-1, 3), coverage.ravel()
    right_hand_side = np.zeros(count)
    system = sparse.csr_array((count, count))
    for first in range(0, len(centers), WINDOWS_AT_ONCE):
        pixels = centers[first : first + WINDOWS_AT_ONCE, None] + steps
        parts = _window_laplacians(flat_colors[pixels].astype(np.float64))
        own, other = np.broadcast_arrays(number[pixels][:, :, None], number[pixels][:, None, :])
        both, edge = (own >= 0) & (other >= 0), (own >= 0) & (other < 0)
        system += sparse.csr_array((parts[both], (own[both], other[both])), (count, count))
        beside = np.broadcast_to(known[pixels][:, None, :], parts.shape)[edge]
        right_hand_side -= np.bincount(own[edge], parts[edge] * beside, count)
    return system, right_hand_side


def _centers(asked: np.ndarray) -> np.ndarray:
    """Running numbers of the pixels whose windows hold a pixel that is asked for and lie inside the picture."""
    near = np.zeros_like(asked)
    for row, column in WINDOW:
        near[1:-1, 1:-1] |= asked[1 + row : asked.shape[0] - 1 + row, 1 + column : asked.shape[1] - 1 + column]
    return np.flatnonzero(near)


def _window_laplacians(colors: np.ndarray) -> np.ndarray:
    """What n windows of colors [n, 9, 3] add to L, [n, 9, 9] (Eq. 12 of the paper)."""
    size = len(WINDOW)
    centered = colors - colors.mean(1, keepdims=True)
    covariances = centered.transpose(0, 2, 1) @ centered / size + REGULARIZATION / size * np.eye(3)
    affinities = (1 + centered @ np.linalg.solve(covariances, centered.transpose(0, 2, 1))) / size
    return np.eye(size) - affinities
