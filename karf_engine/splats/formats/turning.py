"""The half turn between the axes of PLY and those of y-up formats.

PLY files usually have COLMAP's axes (x right, y down, z forward; RDF). Formats that define an up axis are written in
OpenGL's (x right, y up, z backward; RUB), as nianticlabs/spz does.
"""

from __future__ import annotations

import numpy as np

from ..similarity import transform_table

UPRIGHT = np.diag([1.0, -1.0, -1.0, 1.0])  # rotation by 180 degrees about x, its own inverse


def upright(table: np.ndarray) -> np.ndarray:
    """Return a table [n, 11 + 3 K] rotated by 180 degrees about x, exactly."""
    return transform_table(table, UPRIGHT)
