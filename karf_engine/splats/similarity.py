"""Gaussians moved, turned and scaled as a whole, with what they look like from each side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import BadRequest
from .gaussians import Gaussians
from .kernels.arrays import COLOR, LOG_SCALE, LOGIT, ROTATION

TOLERANCE = 1e-5  # deviation from a rotation with a uniform scale that single precision explains
MOVED_OTHERWISE = 0.01  # of what is left to explain: more than files that pack positions lose
ROUNDED = 6  # digits: harmonics are computed in single precision, and flips of axes must be exact
N_DIRECTIONS = 64


def moved(gaussians: Gaussians, matrix: np.ndarray) -> Gaussians:
    """Gaussians in another world, where cameras moved alike see the same.

    Args:
        gaussians: As learned.
        matrix: [4, 4] float64, from their world to the other: a rotation, a uniform scale and a translation.

    Raises:
        BadRequest: The matrix shears, mirrors, scales unequally or is not finite.
    """
    try:
        table = turned(gaussians.table, matrix)
    except ValueError as error:
        raise BadRequest(
            f"The matrix {matrix.tolist()} is not a rotation with a uniform scale and a translation.",
            "Give one without shear, mirroring or unequal scales.",
        ) from error
    if table is gaussians.table:
        return gaussians
    scale = float(np.cbrt(np.linalg.det(matrix[:3, :3])))
    return replace(gaussians, table=table, near=gaussians.near * scale)


def turned(table: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Gaussians moved by a rotation, a uniform scale and a translation; their colors turn with them.

    Args:
        table: [n, 11 + 3 K] as in `gaussians.Gaussians.table`, of any floating type.
        matrix: [4, 4] float64, which moves columns (x, y, z, 1).

    Returns:
        [n, 11 + 3 K] of the same type; the table itself where the matrix is the identity.

    Raises:
        ValueError: The matrix shears, mirrors, or scales unequally.
    """
    if np.allclose(matrix, np.eye(4), rtol=0, atol=TOLERANCE * TOLERANCE):
        return table
    scale, rotation = _parts(matrix)
    result = table.copy()
    result[:, :LOG_SCALE] = table[:, :LOG_SCALE] @ matrix[:3, :3].T + matrix[:3, 3]
    result[:, LOG_SCALE:ROTATION] += np.log(scale)
    result[:, ROTATION:LOGIT] = table[:, ROTATION:LOGIT] @ _quaternion_product(rotation).T
    result[:, COLOR:] = turned_harmonics(table[:, COLOR:], rotation)
    return result


def turned_harmonics(harmonics: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Colors of Gaussians that are turned: what was seen from d is then seen from R d.

    Args:
        harmonics: [n, 3 K], of each harmonic red, green and blue.
        rotation: [3, 3] float64.

    Returns:
        [n, 3 K] of the same type; the same numbers where nothing turns.
    """
    count = harmonics.shape[1] // 3
    if count == 1 or np.array_equal(rotation, np.eye(3)):
        return harmonics
    turn = _harmonics_turn(rotation, count).astype(harmonics.dtype)
    return harmonics @ np.kron(turn, np.eye(3, dtype=turn.dtype)).T


def turn_between(here: np.ndarray, there: np.ndarray) -> np.ndarray:
    """The rotation with which points were moved, beside a uniform scale and a translation (Umeyama 1991).

    Args:
        here: [m, 3], m >= 1, any unit.
        there: [m, 3], the same points where they are now.

    Returns:
        [3, 3] float64; the identity where they were turned by no more than rounding.

    Raises:
        ValueError: They are not as many, or were moved otherwise.
    """
    before, after = (
        points - points.mean(0) for points in (np.asarray(here, np.float64), np.asarray(there, np.float64))
    )
    left, sizes, right = np.linalg.svd(after.T @ before)
    signs = np.array([1, 1, np.sign(np.linalg.det(left @ right))])
    rotation = (left * signs) @ right
    scale = (sizes * signs).sum() / max((before**2).sum(), np.finfo(np.float64).tiny)
    if not np.linalg.norm(after - scale * before @ rotation.T) <= MOVED_OTHERWISE * np.linalg.norm(after):
        raise ValueError("the points were moved one by one")
    return np.eye(3) if np.allclose(rotation, np.eye(3), rtol=0, atol=TOLERANCE) else rotation


def _parts(matrix: np.ndarray) -> tuple[float, np.ndarray]:
    """The uniform scale and the rotation of a matrix."""
    linear = matrix[:3, :3]
    determinant = float(np.linalg.det(linear)) if np.isfinite(matrix).all() else 0.0
    if determinant <= 0 or np.abs(matrix[3] - [0, 0, 0, 1]).max() > TOLERANCE:
        raise ValueError("it is moved by a matrix that is no rotation with a uniform scale")
    scale = float(np.cbrt(determinant))
    rotation = linear / scale
    if np.abs(rotation.T @ rotation - np.eye(3)).max() > TOLERANCE:
        raise ValueError("it is moved by a matrix that shears or scales unequally")
    return scale, rotation


def _quaternion_product(rotation: np.ndarray) -> np.ndarray:
    """[4, 4], which multiplies quaternions w x y z from the left by a rotation's."""
    symmetric = np.empty((4, 4))  # its greatest eigenvector is the quaternion (Bar-Itzhack 2000)
    symmetric[0, 0] = np.trace(rotation)
    symmetric[0, 1:] = symmetric[1:, 0] = [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0],
                                           rotation[1, 0] - rotation[0, 1]]  # fmt: skip
    symmetric[1:, 1:] = rotation + rotation.T - np.trace(rotation) * np.eye(3)
    w, x, y, z = np.round(np.linalg.eigh(symmetric)[1][:, -1], 12)
    return np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])


def _harmonics_turn(rotation: np.ndarray, count: int) -> np.ndarray:
    """[count, count], which turns the harmonics of one color: what is seen from d is then seen from R d."""
    directions = np.random.default_rng(0).normal(size=(N_DIRECTIONS, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    before, after = _harmonics(directions, count), _harmonics(directions @ rotation.T, count)
    return np.round(np.linalg.lstsq(after, before, rcond=None)[0], ROUNDED)


def _harmonics(directions: np.ndarray, count: int) -> np.ndarray:
    """The first harmonics [n, count] of unit directions [n, 3]."""
    from .kernels.harmonics import harmonics  # compiled by numba, which other kinds of files do not need

    values = np.empty((len(directions), count), np.float64)
    for (x, y, z), row in zip(directions, values, strict=True):
        harmonics(x, y, z, count, row)
    return values
