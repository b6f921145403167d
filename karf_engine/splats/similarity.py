"""Similarity transforms of Gaussians, including rotation of their spherical harmonics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import BadRequest
from .gaussians import Gaussians
from .kernels.arrays import COLOR, LOG_SCALE, LOGIT, ROTATION

TOLERANCE = 1e-5  # rounding of single precision
MAX_RESIDUAL = 0.01  # relative to the points; above the quantization of packed files
ROUNDED = 6  # digits of harmonics' rotations, so that flips of axes are exact
N_DIRECTIONS = 64


def transform_gaussians(gaussians: Gaussians, matrix: np.ndarray) -> Gaussians:
    """Return Gaussians after a rotation, uniform scale and translation, [4, 4] float64.

    Raises BadRequest if the matrix shears, mirrors, scales unequally or is not finite.
    """
    try:
        table = transform_table(gaussians.table, matrix)
    except ValueError as error:
        raise BadRequest(
            f"The matrix {matrix.tolist()} is not a rotation with a uniform scale and a translation.",
            "Give one without shear, mirroring or unequal scales.",
        ) from error
    if table is gaussians.table:
        return gaussians
    scale = float(np.cbrt(np.linalg.det(matrix[:3, :3])))
    return replace(gaussians, table=table, near=gaussians.near * scale)


def transform_table(table: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Transform a table of Gaussians, of any floating type; return the table itself if the matrix is the identity.

    Raises ValueError if the matrix shears, mirrors, or scales unequally.
    """
    if np.allclose(matrix, np.eye(4), rtol=0, atol=TOLERANCE * TOLERANCE):
        return table
    linear = matrix[:3, :3]
    determinant = float(np.linalg.det(linear)) if np.isfinite(matrix).all() else 0.0
    if determinant <= 0 or np.abs(matrix[3] - [0, 0, 0, 1]).max() > TOLERANCE:
        raise ValueError("it is moved by a matrix that is no rotation with a uniform scale")
    scale = float(np.cbrt(determinant))
    rotation = linear / scale
    if np.abs(rotation.T @ rotation - np.eye(3)).max() > TOLERANCE:
        raise ValueError("it is moved by a matrix that shears or scales unequally")
    result = table.copy()
    result[:, :LOG_SCALE] = table[:, :LOG_SCALE] @ linear.T + matrix[:3, 3]
    result[:, LOG_SCALE:ROTATION] += np.log(scale)
    result[:, ROTATION:LOGIT] = table[:, ROTATION:LOGIT] @ _quaternion_product(rotation).T
    result[:, COLOR:] = rotate_harmonics(table[:, COLOR:], rotation)
    return result


def mirror_table(table: np.ndarray) -> np.ndarray:
    """Return a table of Gaussians mirrored along z."""
    result = table.copy()
    result[:, 2] *= -1
    result[:, ROTATION + 1 : ROTATION + 3] *= -1
    degrees = range(int(np.sqrt((table.shape[1] - COLOR) // 3)))
    is_odd = [bool(number % 2) for degree in degrees for number in range(2 * degree + 1)]  # in z
    result[:, COLOR:] *= np.repeat(np.where(is_odd, -1, 1), 3).astype(table.dtype)
    return result


def rotate_harmonics(harmonics: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Rotate harmonics [n, 3 K] by a rotation [3, 3]; return them unchanged for the identity."""
    count = harmonics.shape[1] // 3
    if count == 1 or np.array_equal(rotation, np.eye(3)):
        return harmonics
    of_one_color = _harmonics_rotation(rotation, count).astype(harmonics.dtype)
    return harmonics @ np.kron(of_one_color, np.eye(3, dtype=of_one_color.dtype)).T


def estimate_rotation(here: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Estimate the rotation [3, 3] between points [m, 3] before and after a similarity transform (Umeyama 1991).

    It is the exact identity if it is below rounding. Raises ValueError for points moved otherwise.
    """
    before, after = (
        points - points.mean(0) for points in (np.asarray(here, np.float64), np.asarray(there, np.float64))
    )
    left, sizes, right = np.linalg.svd(after.T @ before)
    signs = np.array([1, 1, np.sign(np.linalg.det(left @ right))])
    rotation = (left * signs) @ right
    scale = (sizes * signs).sum() / max((before**2).sum(), np.finfo(np.float64).tiny)
    if not np.linalg.norm(after - scale * before @ rotation.T) <= MAX_RESIDUAL * np.linalg.norm(after):
        raise ValueError("the points were moved one by one")
    return np.eye(3) if np.allclose(rotation, np.eye(3), rtol=0, atol=TOLERANCE) else rotation


def _quaternion_product(rotation: np.ndarray) -> np.ndarray:
    """Return the matrix [4, 4] that multiplies quaternions w x y z from the left by a rotation's."""
    symmetric = np.empty((4, 4))  # its largest eigenvector is the quaternion (Bar-Itzhack 2000)
    symmetric[0, 0] = np.trace(rotation)
    symmetric[0, 1:] = symmetric[1:, 0] = [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0],
                                           rotation[1, 0] - rotation[0, 1]]  # fmt: skip
    symmetric[1:, 1:] = rotation + rotation.T - np.trace(rotation) * np.eye(3)
    w, x, y, z = np.round(np.linalg.eigh(symmetric)[1][:, -1], 12)
    return np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])


def _harmonics_rotation(rotation: np.ndarray, count: int) -> np.ndarray:
    """Return the matrix [count, count] that rotates the harmonics of one color, by least squares over directions."""
    directions = np.random.default_rng(0).normal(size=(N_DIRECTIONS, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    before, after = _harmonics(directions, count), _harmonics(directions @ rotation.T, count)
    return np.round(np.linalg.lstsq(after, before, rcond=None)[0], ROUNDED)


def _harmonics(directions: np.ndarray, count: int) -> np.ndarray:
    """Return the first harmonics [n, count] of unit directions [n, 3]."""
    from .kernels.projection import harmonics  # needs numba, unlike files of degree 0

    values = np.empty((len(directions), count), np.float64)
    for (x, y, z), row in zip(directions, values, strict=True):
        harmonics(x, y, z, count, row)
    return values
