"""Masks as pixels: brush, lasso and box, and PNG files. No bpy.

Places are (x, y) in pixels of the photo, y down, pixel centers at .5. Marks outside the photo are left out.
"""

import struct
import zlib
from collections.abc import Sequence

import numpy as np

Place = tuple[float, float]
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
PNG_COLOR_TYPES = {1: 0, 2: 4}  # by number of channels: gray; gray and alpha


def stroke(layer: np.ndarray, start: Place, end: Place, radius: float, value: int) -> None:
    """Set the pixels [H, W] whose centers a round brush covers."""
    (x0, y0), (x1, y1) = start, end
    rows = _span(min(y0, y1) - radius, max(y0, y1) + radius, layer.shape[0])
    columns = _span(min(x0, x1) - radius, max(x0, x1) + radius, layer.shape[1])
    y, x = np.ogrid[rows, columns]
    x, y = x + 0.5 - x0, y + 0.5 - y0
    dx, dy = x1 - x0, y1 - y0
    share = np.clip((x * dx + y * dy) / max(dx * dx + dy * dy, 1e-12), 0, 1)
    layer[rows, columns][(x - share * dx) ** 2 + (y - share * dy) ** 2 <= radius * radius] = value


def polygon(layer: np.ndarray, places: Sequence[Place], value: int) -> None:
    """Set the pixels [H, W] whose centers are inside a closed line, by the even-odd rule."""
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
    """Set the pixels [H, W] whose centers are in the box between two opposite corners."""
    (x0, x1), (y0, y1) = (sorted(pair) for pair in zip(corner, other, strict=True))
    rows = _span(np.ceil(y0 - 0.5), np.ceil(y1 - 0.5), layer.shape[0])
    layer[rows, _span(np.ceil(x0 - 0.5), np.ceil(x1 - 0.5), layer.shape[1])] = value


def _span(low: float, high: float, size: int) -> slice:
    return slice(int(np.clip(np.floor(low), 0, size)), int(np.clip(np.ceil(high), 0, size)))


def encode_png(pixels: np.ndarray) -> bytes:
    """Return a PNG of gray (and alpha) [H, W, 1 or 2] uint8, which Blender cannot save."""
    height, width, channels = pixels.shape
    head = struct.pack(">2I5B", width, height, 8, PNG_COLOR_TYPES[channels], 0, 0, 0)
    rows = np.zeros((height, 1 + width * channels), np.uint8)  # each begins with its filter: none
    rows[:, 1:] = pixels.reshape(height, -1)
    packer = zlib.compressobj(1, strategy=zlib.Z_RLE)  # masks are long runs
    chunks = ((b"IHDR", head), (b"IDAT", packer.compress(rows) + packer.flush()), (b"IEND", b""))
    return PNG_SIGNATURE + b"".join(
        struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        for kind, content in chunks
    )


def decode_png(content: bytes) -> np.ndarray | None:
    """Return the pixels of a PNG from `encode_png`, ten times faster than Blender; None for other files."""
    if len(content) < 57 or not content.startswith(PNG_SIGNATURE):
        return None
    width, height, depth, color_type, *rest = struct.unpack_from(">2I5B", content, 16)
    size, name = struct.unpack_from(">I4s", content, 33)
    channels = {kind: number for number, kind in PNG_COLOR_TYPES.items()}.get(color_type)
    if depth != 8 or any(rest) or channels is None or name != b"IDAT" or len(content) != 57 + size:
        return None
    try:
        rows = np.frombuffer(zlib.decompress(content[41 : 41 + size]), np.uint8).reshape(height, -1)
    except (zlib.error, ValueError):
        return None
    return None if rows[:, 0].any() else rows[:, 1:].reshape(height, width, channels)
