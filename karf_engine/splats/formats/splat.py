"""antimatter15's .splat: 32 bytes per Gaussian, no header, degree 0 only. Read only.

Format: github.com/antimatter15/splat, main.js: float32 center and scales (not logarithms), bytes red green blue opacity,
bytes 128 + 128 q of the quaternion w x y z. Axes are those of PLY.

Precision: float32 for centers and scales, 1/510 for opacity and color, 1/256 for quaternions.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...capture.reader_utils import read_bytes
from ..kernels.arrays import C0
from .checking import checked, damaged, log_scales, logits
from .splat_file import SplatFile

ROW = np.dtype(
    [("center", "<f4", 3), ("scales", "<f4", 3), ("color", "u1", 3), ("opacity", "u1"), ("rotation", "u1", 4)]
)
HALF_BYTE = 128


def read(path: Path) -> SplatFile:
    """Read Gaussians of a .splat file; a quaternion of four bytes 128 is the identity.

    Raises:
        DataError: The file is missing, its size is not a multiple of 32, or a row is not a Gaussian.
    """
    data = read_bytes(path)
    if len(data) % ROW.itemsize:
        raise damaged(path, f"it has {len(data):,} bytes, which is no multiple of {ROW.itemsize}")
    rows = np.frombuffer(data, ROW)
    rotations = rows["rotation"].astype(np.float64) - HALF_BYTE
    rotations[~rotations.any(1), 0] = 1
    colors = (rows["color"] / 255 - 0.5) / C0
    parts = (rows["center"], log_scales(rows["scales"]), rotations / HALF_BYTE, logits(rows["opacity"] / 255)[:, None])
    return SplatFile(checked(path, np.concatenate([*parts, colors], 1)))
