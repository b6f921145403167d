"""What a frozen radiance field is to the later stages. They do not know whether it is voxels, a NeRF or yours."""

from __future__ import annotations

from typing import Any, ClassVar, Protocol

import torch
from torch import Tensor

from .rendering.rays import Rays
from .rendering.space import Space
from .rendering.volume import Trace


class Field(Protocol):
    """A frozen radiance field, usually an `nn.Module`. Positions, boxes and lengths are in its space's grid coordinates.

    Attributes:
        kind: Name in the registry and in files (see registry.py).
        space: Where the field lies in the world.
        bounds: [2, 3], lowest and highest corner of what there is.
        voxel: Length below which nothing is distinguished: the scale of normals and of the label solve.
        n_features: F, number of prior features.
    """

    kind: ClassVar[str]
    space: Space
    bounds: Tensor
    voxel: float
    n_features: int

    def trace(self, rays: Rays, step_in_voxels: float) -> Trace:
        """Where these rays, in world units, end. step_in_voxels: stride of a field that marches; others ignore it."""

    def density(self, positions: Tensor) -> Tensor:
        """Volume densities [n] >= 0 per grid unit, at positions [n, 3]."""

    def features(self, positions: Tensor) -> Tensor:
        """Prior features [n, F], not standardized, at positions [n, 3]: what the fields on top read."""

    def color(self, positions: Tensor, viewdirs: Tensor, features: Tensor) -> Tensor:
        """sRGB colors [n, 3] in [0, 1] at positions [n, 3], seen along the world's unit viewdirs [n, 3]; features [n, F]
        are those of the positions."""

    def normals(self, positions: Tensor) -> Tensor:
        """Outward surface normals [n, 3] of unit length, or 0 where there is no surface."""

    def summary(self) -> dict[str, Any]:
        """JSON values to report of the field: its size, above all."""

    def config(self) -> dict[str, Any]:
        """JSON values that, with the tensors of `state_dict`, restore the field."""

    @classmethod
    def restore(cls, config: dict[str, Any], tensors: dict[str, Tensor], device: torch.device | str) -> Field:
        """The field of a config and tensors, which are already on the device.

        Both come from a file that others may have changed: any ValueError, KeyError, TypeError, RuntimeError or
        AttributeError raised here tells the user that the file is damaged.
        """

    def state_dict(self) -> dict[str, Tensor]:
        """All tensors of the field, by name."""

    def requires_grad_(self, requires_grad: bool) -> Field:
        """Freeze (False) or release all tensors; returns the field."""
