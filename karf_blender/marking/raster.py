"""Brush, lasso and box as pixels. Places are (x, y) in pixels of the photo, y down, pixel centers at .5. No bpy."""

from collections.abc import Sequence

import numpy as np

Place = tuple[float, float]


def stroke(layer: np.ndarray, start: Place, end: Place, radius: float, value: int) -> None:
    """Set the pixels [H, W] whose centers a round brush covers on its way; what lies outside is left out."""
    (x0, y0), (x1, y1) = start, end
    rows = _span(min(y0, y1) - radius, max(y0, y1) + radius, layer.shape[0])
    columns = _span(min(x0, x1) - radius, max(x0, x1) + radius, layer.shape[1])
    y, x = np.ogrid[rows, columns]
    x, y = x + 0.5 - x0, y + 0.5 - y0
    dx, dy = x1 - x0, y1 - y0
    share = np.clip((x * dx + y * dy) / max(dx * dx + dy * dy, 1e-12), 0, 1)
    layer[rows, columns][(x - share * dx) ** 2 + (y - share * dy) ** 2 <= radius * radius] = value


def polygon(layer: np.ndarray, places: Sequence[Place], value: int) -> None:
    """Set the pixels [H, W] whose centers lie inside a closed line, by the even-odd rule."""
    height, width = layer.shape
    start = np.asarray(places, np.float64).reshape(-1, 2)
    end = np.roll(start, -1, axis=0)
    # the rows whose centers an edge crosses: from the first to before the last
    first, last = (np.clip(np.ceil(y - 0.5), 0, height).astype(int) for y in np.sort([start[:, 1], end[:, 1]], axis=0))
    count = last - first
    edge = np.repeat(np.arange(len(start)), count)
    row = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + first[edge]
    slope = (end - start)[edge]
    x = start[edge, 0] + (row + 0.5 - start[edge, 1]) * slope[:, 0] / slope[:, 1]
    crossings = np.zeros((height, width + 1), np.uint8)
    np.bitwise_xor.at(crossings, (row, np.clip(np.ceil(x - 0.5), 0, width).astype(int)), 1)
    layer[np.bitwise_xor.accumulate(crossings, axis=1)[:, :width].astype(bool)] = value


def box(layer: np.ndarray, corner: Place, other: Place, value: int) -> None:
    """Set the pixels [H, W] whose centers lie in an upright box between two opposite corners."""
    (x0, x1), (y0, y1) = (sorted(pair) for pair in zip(corner, other, strict=True))
    layer[_centers(y0, y1, layer.shape[0]), _centers(x0, x1, layer.shape[1])] = value


def _span(low: float, high: float, size: int) -> slice:
    """The pixels that an interval touches."""
    return slice(int(np.clip(np.floor(low), 0, size)), int(np.clip(np.ceil(high), 0, size)))


def _centers(low: float, high: float, size: int) -> slice:
    """The pixels whose centers an interval holds."""
    return slice(int(np.clip(np.ceil(low - 0.5), 0, size)), int(np.clip(np.ceil(high - 0.5), 0, size)))
