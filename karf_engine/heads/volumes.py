"""Volumes that objects must be inside or outside of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from scipy.spatial import ConvexHull, QhullError
from torch import Tensor, nn

from ..errors import DataError
from ..project.volumes import Volume

TESTS_PER_CHUNK = 1 << 22  # positions times faces


class Volumes(nn.Module):
    """Convex volumes of some of K objects.

    Args:
        faces: [f, 4], planes a x + b y + c z + d = 0 in world coordinates, negative inside.
        volume_of_face: [f] int64, index of the volume.
        rules: [v, 2] int64: index of each volume's object, and 1 if it must be inside, 0 outside.
    """

    faces: Tensor
    volume_of_face: Tensor
    rules: Tensor

    def __init__(self, faces: Tensor, volume_of_face: Tensor, rules: Tensor) -> None:
        super().__init__()
        self.register_buffer("faces", faces.float())
        self.register_buffer("volume_of_face", volume_of_face)
        self.register_buffer("rules", rules)

    @classmethod
    def from_objects(cls, volumes: Mapping[str, Sequence[Volume]], objects: Sequence[str]) -> Volumes:
        """Collect the volumes of these objects; a mesh is replaced by its convex hull. Raises DataError for a flat mesh."""
        chosen = [(k, each) for k, name in enumerate(objects) for each in volumes.get(name, ())]
        faces = [_faces_of(each, objects[k]) for k, each in chosen]
        numbers = [number for number, some in enumerate(faces) for _ in some]
        rules = [[k, int(each.kind == "inside")] for k, each in chosen]
        stacked = torch.from_numpy(np.concatenate([np.zeros((0, 4)), *faces]))
        return cls(stacked, torch.tensor(numbers, dtype=torch.long), torch.tensor(rules, dtype=torch.long))

    def forward(self, positions: Tensor, n_objects: int) -> Tensor:
        """Return whether the volumes allow each object at world positions [n, 3], [n, K] bool."""
        allowed = torch.ones(len(positions), n_objects, dtype=torch.bool, device=positions.device)
        for number, (k, is_inside) in enumerate(self.rules.tolist()):
            faces = self.faces[self.volume_of_face == number]
            parts = positions.float().split(max(1, TESTS_PER_CHUNK // len(faces)))
            within = [(some @ faces[:, :3].T + faces[:, 3] <= 0).all(1) for some in parts]
            allowed[:, k] &= torch.cat(within) == bool(is_inside)
        return allowed


def _faces_of(volume: Volume, name: str) -> np.ndarray:
    """Return the planes that bound a volume, [f, 4]."""
    if volume.matrix is not None:
        axes = np.linalg.inv(volume.matrix)[:3]  # to the cube from -1 to 1
        return np.concatenate([axes, -axes]) - [0, 0, 0, 1]
    assert volume.vertices is not None
    try:
        return ConvexHull(volume.vertices).equations
    except QhullError as error:
        raise DataError(
            "A volume of {name!r} is flat: nothing is inside of it.", "Give its mesh a depth.", name=name
        ) from error
