"""Conversion of spaces to JSON values and between devices."""

from __future__ import annotations

from typing import Any, TypeVar

import torch
from torch import Tensor

from .space import Box, Contraction, Frustum, Similarity, Space

AnySpace = TypeVar("AnySpace", bound=Space)
SPACES: dict[str, type] = {"box": Box, "similarity": Similarity, "contraction": Contraction, "frustum": Frustum}
# shapes of the tensors; all other attributes are numbers
SHAPES = {"world_to_grid": (4, 4), "world_to_camera": (4, 4), "center": (3,), "focal": (2,)}


def space_to_json(space: Space) -> dict[str, Any]:
    """Convert a space to JSON values: its `kind` and its attributes, tensors as nested lists.

    Example:
        >>> space_to_json(Contraction(torch.zeros(3), 2.0, 1.0, 0.5))
        {'kind': 'contraction', 'center': [0.0, 0.0, 0.0], 'radius': 2.0, 'room': 1.0, 'near': 0.5}
    """
    values = {name: v.tolist() if isinstance(v, Tensor) else v for name, v in vars(space).items()}
    return {"kind": type(space).__name__.lower(), **values}


def space_from_json(content: dict[str, Any], device: torch.device | str = "cpu") -> Space:
    """Restore a space from `space_to_json`.

    Raises:
        ValueError, KeyError, TypeError: The values do not describe a space.

    Example:
        >>> space_from_json({"kind": "box"})
        Box()
    """
    values = {
        name: torch.tensor(v, device=device) if isinstance(v, list) else float(v)
        for name, v in content.items()
        if name != "kind"
    }
    for name, value in values.items():
        if isinstance(value, Tensor) != (name in SHAPES) or getattr(value, "shape", None) != SHAPES.get(name):
            raise ValueError(f"a space whose {name} is {content[name]!r:.100}")
    return SPACES[content["kind"]](**values)


def space_to_device(space: AnySpace, device: torch.device | str) -> AnySpace:
    """Copy a space to a device.

    Example:
        >>> space_to_device(Similarity(torch.eye(4)), "cpu").to_grid(torch.tensor([[1.0, 2.0, 3.0]]))
        tensor([[1., 2., 3.]])
    """
    values = {name: v.to(device) if isinstance(v, Tensor) else v for name, v in vars(space).items()}
    return type(space)(**values)
