"""Sparse points of a capture: in PLY files, and their reprojection errors."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import DataError
from ..io.ply import read_ply
from .camera import LARGEST_POSITION
from .capture import Capture, SparsePoints
from .distortion import distort
from .reader_utils import read_bytes

UNCOLORED = 128


def read_points(path: Path) -> SparsePoints:
    """Read the vertices of a PLY file as points without observations; errors are nan, missing colors are gray.

    nerfstudio writes such files. Raises DataError if the file is damaged, or its vertices have no finite x, y, z.
    """
    data = read_bytes(path)
    try:
        table = read_ply(data).table("vertex")
        positions = np.stack([table[axis] for axis in "xyz"], 1).astype(np.float64)
    except ValueError as error:
        raise _damaged(path, str(error)) from error
    if not np.abs(positions).max(initial=0) <= LARGEST_POSITION:
        raise _damaged(path, "it has a point that is not finite")
    return SparsePoints(
        positions=positions,
        colors=_colors(table),
        errors=np.full(len(table), np.nan, np.float32),
        view=np.zeros(0, np.int32),
        point=np.zeros(0, np.int32),
        pixels=np.zeros((0, 2), np.float32),
    )


def _colors(table: np.ndarray) -> np.ndarray:
    if not {"red", "green", "blue"} <= set(table.dtype.names or ()):
        return np.full((len(table), 3), UNCOLORED, np.uint8)
    colors = np.stack([table[name] for name in ("red", "green", "blue")], 1)
    if colors.dtype.kind == "f":
        colors = np.nan_to_num(colors) * 255
    return np.clip(np.round(colors), 0, 255).astype(np.uint8)


def _damaged(path: Path, reason: str) -> DataError:
    return DataError(f"{path} cannot be read as sparse points: {reason}.", "Copy or export the file again.")


# --------------------------------------------------------------------------------------------------- reprojection errors
@dataclass(frozen=True)
class ErrorSummary:
    """Reprojection errors of one view, in pixels of the photo as stored."""

    count: int  # of observed points
    median: float
    worst: float  # infinite for a point behind the camera

    def __str__(self) -> str:
        return f"{self.count} points, median error {self.median:.2f} px, worst {self.worst:.2f} px"


def reprojection_errors(capture: Capture, view_number: int) -> tuple[np.ndarray, np.ndarray]:
    """Return observed and projected pixels [m, 2] float64, of the photo as stored, of the sparse points of a view.

    Projections are nan behind the camera or outside the valid radius of its lens. Raises DataError without points.
    """
    camera, points = capture.views[view_number].camera, _points(capture)
    pixels, depth = camera.project(observed_points(capture, view_number))
    pixels[depth <= 0] = np.nan
    return points.pixels[points.view == view_number].astype(np.float64), distort(camera, pixels)


def observed_points(capture: Capture, view_number: int) -> np.ndarray:
    """Return the world positions [m, 3] float64 of the points that a view observed. Raises DataError without points."""
    points = _points(capture)
    return points.positions[points.point[points.view == view_number]]


def _points(capture: Capture) -> SparsePoints:
    if capture.points is None:
        raise DataError(f"{capture.source} has no sparse points.", "Only captures with a COLMAP model have them.")
    return capture.points


def summarize(observed: np.ndarray, projected: np.ndarray) -> ErrorSummary:
    """Summarize the distances between pixels [m, 2] and [m, 2]; zeros if there are none."""
    errors = np.nan_to_num(np.linalg.norm(observed - projected, axis=-1), nan=np.inf)
    if not len(errors):
        return ErrorSummary(0, 0.0, 0.0)
    return ErrorSummary(len(errors), float(np.median(errors)), float(errors.max()))
