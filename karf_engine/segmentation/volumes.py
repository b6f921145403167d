"""Which surface points cannot be which object, because they lie outside of a volume that it must be in, or inside one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial import Delaunay, QhullError

from ..errors import DataError
from ..project.volumes import Volume


def allowed_classes(
    volumes: Mapping[str, Sequence[Volume]], objects: Sequence[str], positions: np.ndarray
) -> np.ndarray:
    """Which classes points may have, [p, K+1] bool; the background always.

    Args:
        volumes: of some objects, by their names; those of others are left alone.
        objects: names of the K objects.
        positions: [p, 3] in the capture's world.

    Raises:
        DataError: a mesh is flat.
    """
    allowed = np.ones((len(positions), len(objects) + 1), bool)
    for number, name in enumerate(objects, 1):
        for volume in volumes.get(name, ()):
            allowed[:, number] &= _inside(volume, name, positions) == (volume.kind == "inside")
    return allowed


def _inside(volume: Volume, name: str, positions: np.ndarray) -> np.ndarray:
    """Whether points lie in a volume, [p] bool; a mesh's is its convex hull."""
    if volume.matrix is not None:
        inverse = np.linalg.inv(volume.matrix)
        return (abs(positions @ inverse[:3, :3].T + inverse[:3, 3]) <= 1).all(1)
    try:
        return Delaunay(volume.vertices).find_simplex(positions) >= 0
    except QhullError as error:
        raise DataError(f"A volume of {name!r} is flat: nothing is inside of it.", "Give its mesh a depth.") from error
