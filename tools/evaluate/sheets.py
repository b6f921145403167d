"""Contact sheets: rows of pictures of a few test views."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from karf_engine.io.images import write_png

SHEET_ROWS = 4
MASK_COLORS = np.array([(1, 0, 0), (0, 0, 1), (0, 1, 0), (1, 1, 0), (1, 0, 1), (0, 1, 1)], np.float32)
TOO_MUCH, MISSED = np.array([1.0, 0.2, 0.1]), np.array([0.2, 0.5, 1.0])


def sheet_numbers(n_views: int) -> list[int]:
    """Which views a contact sheet shows, spread over all."""
    return np.linspace(0, n_views - 1, min(SHEET_ROWS, n_views)).astype(int).tolist()


def tinted(photo: np.ndarray, masks: np.ndarray) -> np.ndarray:
    """Masks [K, H, W] in plain colors over a dark photo."""
    picture = photo * 0.35
    for number, mask in enumerate(masks):
        picture[mask] += 0.65 * MASK_COLORS[number % len(MASK_COLORS)]
    return picture


def difference(photo: np.ndarray, masks: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Over a dark gray photo, what masks [K, H, W] cover too much of in red, and what they miss in blue."""
    picture = np.repeat(photo.mean(-1, keepdims=True) * 0.35, 3, -1)
    too_much, missed = (masks & ~truth).any(0), (truth & ~masks).any(0)
    picture[too_much] = TOO_MUCH
    picture[missed] = MISSED
    return picture


def write_sheet(path: Path, rows: list[list[np.ndarray]]) -> None:
    """Write rows of equally large pictures as one."""
    write_png(path, np.concatenate([np.concatenate(row, 1) for row in rows], 0))


def square_of_most(values: np.ndarray, most_side: int) -> tuple[tuple[slice, slice], float]:
    """The square in which values [H, W] have the largest sum, and that sum; it is `most_side` wide, or as the picture is."""
    side = min(most_side, *values.shape)
    sums = np.pad(values.cumsum(0).cumsum(1), ((1, 0), (1, 0)))
    inside = sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]
    top, left = np.unravel_index(inside.argmax(), inside.shape)
    return (slice(top, top + side), slice(left, left + side)), float(inside.max())
