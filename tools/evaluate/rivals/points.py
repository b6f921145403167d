"""The surface points that a decomposition learns an object from, and the small network that is evaluated there."""

from __future__ import annotations

from dataclasses import dataclass, fields

import torch
from torch import Tensor, nn

from karf_engine.heads.fields import scale_positions
from karf_engine.heads.files import load_surface
from karf_engine.heads.training_rays import ObjectSurface
from karf_engine.kan.gated_block import MLPHead
from karf_engine.kan.inputs import Standardizer, positional_encoding
from karf_engine.recolor.model import Model

FREQUENCIES, DIRECTION_FREQUENCIES = 5, 2  # octaves of the encodings
MOST_POINTS = 30_000  # of an object: more do not fit better in so few iterations


@dataclass(frozen=True)
class ObjectPoints:
    """Where n training rays end well inside an object, and what the photos show there.

    Attributes:
        positions: [n, 3] grid coordinates.
        viewdirs: [n, 3] of unit length.
        features: [n, F] prior features of the frozen field.
        colors: [n, 3] of the photos, sRGB in [0, 1].
    """

    positions: Tensor
    viewdirs: Tensor
    features: Tensor
    colors: Tensor

    def __len__(self) -> int:
        return len(self.colors)

    def __getitem__(self, index: Tensor) -> ObjectPoints:
        return ObjectPoints(*[getattr(self, field.name)[index] for field in fields(self)])


def points_of_objects(model: Model) -> dict[str, ObjectPoints]:
    """The points of each object: the rays that our own palettes and F_w are learned from, the middle sample of each."""
    surface, names = load_surface(model.project.verified(model.project.surface_file))
    return {name: _points(model, surface, number) for number, name in enumerate(names)}


@torch.no_grad()
def _points(model: Model, surface: ObjectSurface, number: int) -> ObjectPoints:
    own = surface.object == number
    rays = torch.nonzero(own & surface.interior if (own & surface.interior).any() else own).squeeze(1)
    rays = rays[:: len(rays) // MOST_POINTS + 1]
    positions = surface.positions[rays, surface.positions.shape[1] // 2]
    features = model.scene.field.features(positions)
    return ObjectPoints(positions, surface.viewdirs[rays], features, surface.colors[rays].float() / 255)


class PointHead(nn.Module):
    """Two hidden layers from a point's encoded position and prior features to n_out numbers; the field stays as it is.

    Args:
        points: Of the object; their box and the scale of their features are remembered.
        n_out: Number of outputs.
        sees: Whether it also reads the direction that the point is seen from.
    """

    def __init__(self, points: ObjectPoints, n_out: int, sees: bool = False) -> None:
        super().__init__()
        self.sees = sees
        self.register_buffer("bounds", torch.stack([points.positions.amin(0), points.positions.amax(0)]))
        self.standardizer = Standardizer(points.features.shape[1])
        self.standardizer.fit(points.features)
        n_direction = 3 + 6 * DIRECTION_FREQUENCIES if sees else 0
        self.head = MLPHead(3 + 6 * FREQUENCIES, n_direction, points.features.shape[1], n_out)

    def forward(self, positions: Tensor, features: Tensor, viewdirs: Tensor) -> Tensor:
        """[n, n_out] at positions [n, 3] with features [n, F], seen along viewdirs [n, 3]."""
        encoded = positional_encoding(scale_positions(positions, self.bounds), FREQUENCIES)
        directions = positional_encoding(viewdirs, DIRECTION_FREQUENCIES) if self.sees else None
        return self.head(encoded, self.standardizer(features), directions)
