"""The two KaRF fields on a frozen radiance field (paper, Eq. 7 and 10): F_s segments objects, F_w mixes palette colors.

Both read positions scaled to [-1, 1] and standardized prior features; F_w also reads the viewing direction. Volumes
restrict where F_s has objects.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from scipy.spatial import ConvexHull, QhullError
from torch import Tensor, nn

from ..errors import DataError
from ..fields.rendering.space import Space
from ..kan.inputs import Standardizer, positional_encoding
from ..project.settings import RecoloringSettings, SegmentationSettings
from ..project.volumes import Volume
from .registry import build_head

TESTS_PER_CHUNK = 1 << 22  # positions times faces


def scale_positions(positions: Tensor, bounds: Tensor) -> Tensor:
    """Map positions [n, 3] so that the box `bounds` [2, 3] is [-1, 1] along its longest side."""
    center = bounds.mean(0)
    half = (bounds[1] - bounds[0]).max() / 2
    return (positions - center) / half


class SegmentationField(nn.Module):
    """F_s of Eq. 7: probabilities of K + 1 classes at positions; class 0 is the background."""

    boxes: Tensor  # [K, 2, 3] least and greatest corners, grid coordinates; an object has probability 0 outside its box
    bounds: Tensor  # [2, 3] of all boxes

    def __init__(
        self,
        boxes: Tensor,
        n_features: int,  # F, of the prior
        settings: SegmentationSettings,
        volumes: Volumes | None = None,  # that objects must be inside or outside of
        space: Space | None = None,  # of the scene's field, for volumes
    ) -> None:
        super().__init__()
        self.volumes, self.space = volumes, space
        self.frequencies = settings.frequencies
        self.register_buffer("boxes", boxes.float())
        self.register_buffer("bounds", torch.stack([boxes[:, 0].amin(0), boxes[:, 1].amax(0)]).float())
        self.standardizer = Standardizer(n_features)
        self.head = build_head(settings, 3 + 6 * settings.frequencies, 0, n_features, len(boxes) + 1)

    def logits(self, positions: Tensor, prior_features: Tensor) -> Tensor:
        """Return class logits [n, K+1] for positions [n, 3] and prior features [n, F]."""
        encoded = positional_encoding(scale_positions(positions, self.bounds), self.frequencies)
        return self.head(encoded, self.standardizer(prior_features))

    def inside(self, positions: Tensor) -> Tensor:
        """Return where the boxes and volumes allow an object, [n, K] bool for positions [n, 3]."""
        point = positions[:, None]
        boxed = ((point >= self.boxes[:, 0]) & (point <= self.boxes[:, 1])).all(-1)
        if self.volumes is None:
            return boxed
        assert self.space is not None, "volumes need the space of the scene's field"
        return boxed & self.volumes(self.space.to_world(positions), len(self.boxes))

    def forward(self, positions: Tensor, prior_features: Tensor) -> Tensor:
        """Return class probabilities [n, K+1] for positions [n, 3] (grid coordinates) and prior features [n, F]."""
        logits = self.logits(positions, prior_features)
        excluded = torch.zeros_like(logits)
        excluded[:, 1:] = torch.where(self.inside(positions), 0.0, -torch.inf)
        return torch.softmax(logits + excluded, 1)


class RecoloringField(nn.Module):
    """F_w of Eq. 10: palette weights at positions and viewing directions, a block of M weights for each palette.

    bounds: [2, 3] of F_s, grid coordinates. n_features: F, of the prior. sizes: number of colors of each palette, black
    included; M is the largest. A shared palette is a single block.
    """

    bounds: Tensor
    missing: Tensor

    def __init__(self, bounds: Tensor, n_features: int, sizes: list[int], settings: RecoloringSettings) -> None:
        super().__init__()
        self.frequencies = settings.frequencies
        self.direction_frequencies = settings.direction_frequencies
        self.n_blocks, self.n_colors = len(sizes), max(sizes)
        self.register_buffer("bounds", bounds.float())
        missing = torch.arange(self.n_colors) >= torch.tensor(sizes)[:, None]
        self.register_buffer("missing", missing, persistent=False)
        self.standardizer = Standardizer(n_features)
        self.head = build_head(
            settings,
            3 + 6 * settings.frequencies,
            3 + 6 * settings.direction_frequencies,
            n_features,
            self.n_blocks * self.n_colors,
        )

    def forward(self, positions: Tensor, viewdirs: Tensor, prior_features: Tensor) -> Tensor:
        """Return palette weights [n, blocks, M] >= 0; each block sums to 1.

        positions: [n, 3] grid coordinates. viewdirs: [n, 3], unit length. prior_features: [n, F], not standardized.
        """
        logits = self.head(
            positional_encoding(scale_positions(positions, self.bounds), self.frequencies),
            self.standardizer(prior_features),
            positional_encoding(viewdirs, self.direction_frequencies),
        ).view(-1, self.n_blocks, self.n_colors)
        return torch.softmax(logits.masked_fill(self.missing, -torch.inf), 2)


class Volumes(nn.Module):
    """Convex volumes of some of K objects."""

    faces: Tensor  # [f, 4] planes a x + b y + c z + d = 0, world coordinates, negative inside
    volume_of_face: Tensor  # [f] int64
    rules: Tensor  # [v, 2] int64: index of the object; 1 if it must be inside, 0 outside

    def __init__(self, faces: Tensor, volume_of_face: Tensor, rules: Tensor) -> None:
        super().__init__()
        self.register_buffer("faces", faces.float())
        self.register_buffer("volume_of_face", volume_of_face)
        self.register_buffer("rules", rules)

    @classmethod
    def from_objects(cls, volumes: Mapping[str, Sequence[Volume]], objects: Sequence[str]) -> Volumes:
        """Collect the volumes of these objects, of meshes their convex hulls. Raises DataError for a flat mesh."""
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
