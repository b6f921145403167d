"""The protocol of radiance fields: all that later stages know of one."""

from __future__ import annotations

from typing import Any, Protocol

import torch
from torch import Tensor

from .rendering.rays import Rays
from .rendering.space import Space
from .rendering.volume import Trace


class Field(Protocol):
    """A frozen radiance field, usually an `nn.Module`. Positions, boxes and lengths are in grid coordinates."""

    @property
    def kind(self) -> str: ...  # name in the registry and in files (see registry.py)
    @property
    def space(self) -> Space: ...  # the map from the world to grid coordinates
    @property
    def bounds(self) -> Tensor: ...  # lowest and highest corner of the contents, [2, 3]
    @property
    def voxel(self) -> float: ...  # the finest resolved length, the scale of normals and of the label solve
    @property
    def n_features(self) -> int: ...  # F, the number of prior features

    def trace(self, rays: Rays, step_in_voxels: float) -> Trace:
        """Sample rays in world units. Fields that do not march ignore `step_in_voxels`."""
        ...

    def density(self, positions: Tensor) -> Tensor:
        """Return volume densities [n] >= 0, per grid unit, at positions [n, 3]."""
        ...

    def features(self, positions: Tensor) -> Tensor:
        """Return prior features [n, F], not standardized, at positions [n, 3]; the input of the later fields."""
        ...

    def color(self, positions: Tensor, viewdirs: Tensor, features: Tensor) -> Tensor:
        """Return sRGB colors [n, 3] in [0, 1], for unit directions [n, 3] in the world and the features [n, F] there."""
        ...

    def normals(self, positions: Tensor) -> Tensor:
        """Return outward unit normals [n, 3], or 0 where there is no surface."""
        ...

    def summary(self) -> dict[str, Any]:
        """Return JSON values for reports, such as the size."""
        ...

    def config(self) -> dict[str, Any]:
        """Return the JSON values that restore the field together with `state_dict`."""
        ...

    @classmethod
    def restore(cls, config: dict[str, Any], tensors: dict[str, Tensor], device: torch.device | str) -> Field:
        """Restore a field from its config and tensors, which are on the device.

        The file is not trusted: ValueError, KeyError, TypeError, RuntimeError or AttributeError report it as damaged.
        """
        ...

    def state_dict(self) -> dict[str, Tensor]:
        """Return all tensors by name."""
        ...

    def requires_grad_(self, requires_grad: bool) -> Field:
        """Freeze (False) or unfreeze all tensors; return the field."""
        ...
