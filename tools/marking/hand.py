"""A simulated hand with a brush: what it finds wrong in a mask, and the strokes that it draws there."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import sparse
from scipy.ndimage import distance_transform_edt, label
from scipy.sparse.csgraph import dijkstra

BRUSH, LENGTH = 0.02, 0.15  # of the picture's long side: the brush's radius, the length of a short stroke
NARROW = 2.0  # pixels from the middle of an error to its border: less is not an error that a hand would correct
Path = tuple[np.ndarray, np.ndarray]  # rows and columns of pixels


def largest_error(found: np.ndarray, true: np.ndarray, certain: np.ndarray) -> tuple[np.ndarray, bool]:
    """The largest connected error of a mask among certain pixels, and whether the object is missing there."""
    missing, too_much = _largest(certain & true & ~found), _largest(certain & found & ~true)
    return (missing, True) if missing.sum() >= too_much.sum() else (too_much, False)


def _largest(error: np.ndarray) -> np.ndarray:
    parts, count = label(error)
    return parts == 1 + np.bincount(parts.ravel())[1:].argmax() if count else error


def can_be_hit(error: np.ndarray) -> bool:
    """Whether an error is wide enough for a hand to correct it."""
    return bool(error.any() and _depth(error).max() >= NARROW)


def _depth(mask: np.ndarray) -> np.ndarray:
    """Pixels from each place in a mask to its border, which the picture's is too."""
    return distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1]


def short_line(error: np.ndarray) -> np.ndarray:
    """A short straight line from the middle of an error, as far as a brush stays inside it."""
    inside, middle, radius = _brush_in(error)
    ends = np.argwhere(inside >= 0.9 * radius)
    ends = ends[np.linalg.norm(ends - middle, axis=1) <= LENGTH / 2 * max(error.shape)]
    lines = [line for line in (_line(middle, end) for end in ends) if (inside[line] >= 0.9 * radius).all()]
    return _drawn(error, max(lines, key=_length), radius)


def along(error: np.ndarray) -> np.ndarray:
    """A curved stroke along all of an error, as far as a brush stays inside it, from one end to the other."""
    inside, middle, radius = _brush_in(error)
    pixels = np.argwhere(inside >= 0.9 * radius)
    number = np.full(error.shape, -1)
    number[tuple(pixels.T)] = np.arange(len(pixels))
    steps = _steps(number, inside)
    start = int(number[tuple(middle)])
    one, _ = _farthest(steps, start)
    other, before = _farthest(steps, one)
    path = [other]
    while path[-1] != one:
        path.append(before[path[-1]])
    return _drawn(error, tuple(pixels[path].T), radius)


HANDS: dict[str, Callable[[np.ndarray], np.ndarray]] = {"line": short_line, "along": along}


def _brush_in(error: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """How deep each pixel lies in an error, its middle, and the brush's radius."""
    inside = _depth(error)
    middle = np.array(np.unravel_index(inside.argmax(), error.shape))
    return inside, middle, min(BRUSH * max(error.shape), 0.8 * inside[tuple(middle)])


def _steps(number: np.ndarray, inside: np.ndarray) -> sparse.csr_matrix:
    """Steps between numbered neighbors; in the middle of an error they are shorter."""
    rows, columns, lengths = [], [], []
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        here = number[: len(number) - down, max(0, -right) : number.shape[1] - max(0, right)]
        there = number[down:, max(0, right) : number.shape[1] + min(0, right)]
        both = (here >= 0) & (there >= 0)
        rows.append(here[both]), columns.append(there[both])
        lengths.append(np.full(both.sum(), np.hypot(down, right)))
    depth = inside[number >= 0]
    rows, columns = np.concatenate(rows), np.concatenate(columns)
    cost = np.concatenate(lengths) * (1 / depth[rows] + 1 / depth[columns])
    return sparse.csr_matrix((cost, (rows, columns)), (len(depth), len(depth)))


def _farthest(steps: sparse.csr_matrix, start: int) -> tuple[int, np.ndarray]:
    """The pixel that is farthest from one, and each pixel's predecessor on the way to it."""
    distance, before = dijkstra(steps, directed=False, indices=start, return_predecessors=True)
    return int(np.where(np.isfinite(distance), distance, -1).argmax()), before


def _drawn(error: np.ndarray, path: Path, radius: float) -> np.ndarray:
    away = np.ones(error.shape, bool)
    away[path] = False
    return error & (distance_transform_edt(away) <= radius - 0.5)


def _line(start: np.ndarray, end: np.ndarray) -> Path:
    steps = np.linspace(0, 1, int(abs(end - start).max()) + 1)[:, None]
    return tuple(np.round(start + steps * (end - start)).astype(int).T)


def _length(path: Path) -> float:
    return float(np.hypot(path[0][-1] - path[0][0], path[1][-1] - path[1][0]))
