"""Gaussians in other axes.

A PLY file's axes are usually COLMAP's: x right, y down, z forward, as the first camera saw the scene. The kinds whose
specification names an upward axis are written turned by half a turn round x: x right, y up, z backward, the axes of a
camera of OpenGL, glTF, USD and Blender. That is what nianticlabs/spz does between its RDF (PLY) and RUB (SPZ).
"""

from __future__ import annotations

import numpy as np

from ..similarity import turned

UPRIGHT = np.diag([1.0, -1.0, -1.0, 1.0])  # half a turn round x, its own inverse


def upright(table: np.ndarray) -> np.ndarray:
    """Gaussians turned by half a turn round x, there or back, exactly: [n, 11 + 3 K]."""
    return turned(table, UPRIGHT)
