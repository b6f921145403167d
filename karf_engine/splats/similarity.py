"""Gaussians moved, turned and scaled as a whole, with what they look like from each side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import BadRequest
from .gaussians import DEGREES, Gaussians
from .kernels.arrays import CENTER, COLOR, LOG_SCALE, LOGIT, ROTATION

TOLERANCE = 1e-4  # of a rotation's entries
DIRECTIONS = 32  # in which harmonics are compared; the largest degree has seven


def moved(gaussians: Gaussians, matrix: np.ndarray) -> Gaussians:
    """Gaussians in another world, where cameras moved alike see the same.

    Args:
        gaussians: As learned.
        matrix: [4, 4], from their world to the other: a rotation, a uniform scale and a translation.

    Raises:
        BadRequest: The matrix shears, mirrors, scales unequally or is not finite.
    """
    matrix = np.asarray(matrix, np.float64)
    if np.array_equal(matrix, np.eye(4)):
        return gaussians
    scale, rotation = _parts(matrix)
    before, table = gaussians.table, gaussians.table.copy()
    centers = before[:, CENTER:LOG_SCALE].astype(np.float64)
    table[:, CENTER:LOG_SCALE] = centers @ matrix[:3, :3].T + matrix[:3, 3]
    table[:, LOG_SCALE:ROTATION] = before[:, LOG_SCALE:ROTATION] + np.log(scale)
    if not np.array_equal(rotation, np.eye(3)):
        own = Rotation.from_quat(before[:, ROTATION:LOGIT], scalar_first=True)
        table[:, ROTATION:LOGIT] = (Rotation.from_matrix(rotation) * own).as_quat(scalar_first=True)
        table[:, COLOR:] = turned_harmonics(before[:, COLOR:], rotation)
    return replace(gaussians, table=table, near=gaussians.near * scale)


def turned_harmonics(harmonics: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Coefficients of what is turned: of each degree a linear map of its own (Ivanic and Ruedenberg 1996, here by
    least squares over directions).

    Args:
        harmonics: [n, 3 K] float32, K of red, green and blue each.
        rotation: [3, 3].
    """
    degree = DEGREES[harmonics.shape[1] // 3]
    ways = np.random.default_rng(0).normal(size=(DIRECTIONS, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    there, here = _basis(ways), _basis(ways @ rotation)  # what is seen from v was seen from R^T v
    result = harmonics.reshape(len(harmonics), -1, 3).copy()
    for own in range(1, degree + 1):
        columns = slice(own * own, (own + 1) ** 2)
        turn = np.linalg.lstsq(there[:, columns], here[:, columns], rcond=None)[0]
        result[:, columns] = np.einsum("ij,njc->nic", turn, harmonics.reshape(result.shape)[:, columns])
    return result.reshape(harmonics.shape)


def _basis(ways: np.ndarray) -> np.ndarray:
    """All sixteen harmonics of unit directions [d, 3], [d, 16] float64."""
    from .kernels.harmonics import harmonics  # needs numba

    values = np.empty((len(ways), 16))
    for row, (x, y, z) in zip(values, ways, strict=True):
        harmonics(x, y, z, 16, row)
    return values


def _parts(matrix: np.ndarray) -> tuple[float, np.ndarray]:
    """The scale and the rotation [3, 3] of a similarity."""
    with np.errstate(all="ignore"):
        scale = float(np.cbrt(np.linalg.det(matrix[:3, :3])))
        rotation = matrix[:3, :3] / scale
        is_similarity = (
            np.isfinite(matrix).all()
            and scale > 0
            and np.abs(rotation @ rotation.T - np.eye(3)).max() < TOLERANCE
            and np.array_equal(matrix[3], (0, 0, 0, 1))
        )
    if not is_similarity:
        raise BadRequest(
            f"The matrix {matrix.tolist()} is not a rotation with a uniform scale and a translation.",
            "Give one without shear, mirroring or unequal scales.",
        )
    return scale, rotation
