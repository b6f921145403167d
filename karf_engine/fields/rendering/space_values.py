"""Spaces as plain values, as files hold them; and on a device."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import torch
from torch import Tensor

from .space import Box, Contraction, Frustum, Similarity, Space

SPACES: dict[str, type] = {
    "box": Box,
    "similarity": Similarity,
    "contraction": Contraction,
    "frustum": Frustum,
}
SHAPES = {"world_to_grid": (4, 4), "world_to_camera": (4, 4), "center": (3,), "focal": (2,)}  # others are numbers


def space_to_json(space: Space) -> dict[str, Any]:
    """Plain values of a space; `space_from_json` gives it back.

    Args:
        space: One of SPACES.

    Returns:
        Its `kind` and its attributes, tensors as nested lists.

    Example:
        >>> space_to_json(Contraction(torch.zeros(3), 2.0, 1.0, 0.5))
        {'kind': 'contraction', 'center': [0.0, 0.0, 0.0], 'radius': 2.0, 'room': 1.0, 'near': 0.5}
    """
    values = {name: v.tolist() if isinstance(v, Tensor) else v for name, v in vars(space).items()}
    return {"kind": type(space).__name__.lower(), **values}


def space_from_json(content: dict[str, Any], device: torch.device | str = "cpu") -> Space:
    """The space of these values.

    Args:
        content: As `space_to_json` gives it, perhaps changed by others.
        device: Where its tensors live.

    Returns:
        The space.

    Raises:
        ValueError, KeyError, TypeError: The values are none of a space.

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


def space_on(space: Space, device: torch.device | str) -> Space:
    """The same space with its tensors on a device: that of all that is mapped by it.

    Args:
        space: Any.
        device: Where its tensors shall live.

    Returns:
        The space there.

    Example:
        >>> space_on(Similarity(torch.eye(4)), "cpu").to_grid(torch.tensor([[1.0, 2.0, 3.0]]))
        tensor([[1., 2., 3.]])
    """
    return replace(
        space, **{name: value.to(device) for name, value in vars(space).items() if isinstance(value, Tensor)}
    )
