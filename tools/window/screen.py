"""The virtual screen as a picture: X window dumps, which `Xvfb -fbdir` keeps up to date in a file."""

from __future__ import annotations

import struct

import numpy as np

VERSION = 7
FIELDS = 25  # 32 bit numbers of the header, big end first
TRUE_COLOR = 4


def read_dump(data: bytes) -> np.ndarray:
    """The pixels [H, W, 3] uint8 of a window dump with 32 bits a pixel. Raises ValueError for another kind of dump."""
    if len(data) < 4 * FIELDS:
        raise ValueError(f"a window dump has at least {4 * FIELDS} bytes, not {len(data)}")
    header = struct.unpack(f">{FIELDS}I", data[: 4 * FIELDS])
    header_size, version, _, _, width, height, _, byte_order = header[:8]
    bits, line, visual = header[11:14]
    masks, n_colors = header[14:17], header[19]
    if version != VERSION or bits != 32 or visual != TRUE_COLOR:
        raise ValueError(f"a window dump of version {version} with {bits} bits of visual {visual} is not known")
    start = header_size + 12 * n_colors
    if len(data) < start + line * height:
        raise ValueError(
            f"a window dump of {width} x {height} pixels has {start + line * height} bytes, not {len(data)}"
        )
    pixels = np.frombuffer(data, ">u4" if byte_order else "<u4", line * height // 4, start)
    pixels = pixels.reshape(height, line // 4)[:, :width]
    channels = [(pixels & mask) >> ((mask & -mask).bit_length() - 1) for mask in masks]
    return np.stack(channels, -1).astype(np.uint8)
