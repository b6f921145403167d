"""Conversion between tables of Gaussians and gsply's containers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..kernels.arrays import COLOR, LOG_SCALE, LOGIT, ROTATION

if TYPE_CHECKING:
    from gsply import GSData


def to_package(table: np.ndarray) -> GSData:
    """Return gsply's container of a table [n, 11 + 3 K], with unit quaternions. Raises ImportError without gsply."""
    from gsply import GSData

    rotations = table[:, ROTATION:LOGIT].astype(np.float64)
    rotations /= np.linalg.norm(rotations, axis=1, keepdims=True)
    parts = (
        table[:, :LOG_SCALE],
        table[:, LOG_SCALE:ROTATION],
        rotations,
        table[:, LOGIT],
        table[:, COLOR : COLOR + 3],
    )
    means, scales, quats, opacities, sh0 = (np.ascontiguousarray(part, np.float32) for part in parts)
    rest = np.ascontiguousarray(table[:, COLOR + 3 :], np.float32).reshape(len(table), -1, 3)
    return GSData.from_arrays(means, scales, quats, opacities, sh0, rest if rest.size else None, format="ply")


def from_package(packed: GSData) -> np.ndarray:
    """Return the table [n, 11 + 3 K] float32 of gsply's container."""
    parts = [packed.means, packed.scales, packed.quats, packed.opacities[:, None], packed.sh0]
    if packed.shN is not None and packed.shN.size:
        parts.append(packed.shN.reshape(len(packed.means), -1))
    return np.concatenate(parts, axis=1, dtype=np.float32)
