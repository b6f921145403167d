"""PNG files of masks as bytes: gray, or gray with alpha, which Blender's own images cannot be saved as."""

import struct
import zlib

import numpy as np

SIGNATURE = b"\x89PNG\r\n\x1a\n"
COLOR_TYPES = {1: 0, 2: 4}  # by channels: gray; gray and alpha
LEVEL = 3  # of zlib: masks are long runs


def encode(pixels: np.ndarray) -> bytes:
    """A PNG (W3C PNG, third edition) of pixels [H, W, 1 or 2] uint8: gray, or gray and alpha."""
    height, width, channels = pixels.shape
    head = struct.pack(">2I5B", width, height, 8, COLOR_TYPES[channels], 0, 0, 0)
    rows = np.zeros((height, 1 + width * channels), np.uint8)  # each begins with its filter: none
    rows[:, 1:] = pixels.reshape(height, -1)
    chunks = ((b"IHDR", head), (b"IDAT", zlib.compress(rows, LEVEL)), (b"IEND", b""))
    return SIGNATURE + b"".join(_chunk(*chunk) for chunk in chunks)


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
