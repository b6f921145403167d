"""Scene files: `geometry.safetensors`."""

from __future__ import annotations

from pathlib import Path

import torch

from ..errors import DataError
from ..io.checkpoints import damage_as_data_error, load_tensors, save_tensors
from .registry import field_kind, field_kinds
from .scene import Background, Scene
from .training import add_prefix, strip_prefix

SCHEMA = "karf-geometry/1"
BACKGROUNDS = ("alpha", "black", "white", "opaque")
STEPS = 0.01, 10.0  # step range in voxels: finer ones take forever, coarser ones miss surfaces


def save_scene(scene: Scene, path: Path) -> None:
    """Save a scene: its tensors, and JSON values in the header."""
    tensors = add_prefix("field", scene.field.state_dict())
    if scene.background is not None:
        tensors |= add_prefix("background", scene.background.state_dict())
    own = {"kind": scene.field.kind, "background_kind": scene.background_kind, "step": scene.step}
    save_tensors(path, tensors, SCHEMA, scene.field.config() | own)


def load_scene(path: Path, device: torch.device | str = "cpu") -> Scene:
    """Load a scene with a frozen field.

    Raises:
        DataError: The file is missing or damaged, or its kind of field is not registered.
    """
    tensors, config = load_tensors(path, SCHEMA, device)
    with damage_as_data_error(path):
        kind = config.get("kind", "voxels")
        if kind not in field_kinds():
            raise DataError(
                f"{path} holds a field of the unknown kind {kind!r:.200}.",
                f"Known are {', '.join(field_kinds())}; install the package that brings this one, or import its module.",
            )
        field = field_kind(kind).restore(config, strip_prefix("field", tensors), device)
        background = None
        if learned := strip_prefix("background", tensors):
            background = Background().to(device)
            background.load_state_dict(learned)
        background_kind, step = config["background_kind"], config["step"]
        if background_kind not in BACKGROUNDS or not STEPS[0] <= step <= STEPS[1]:
            raise ValueError(f"background {background_kind!r}, step {step!r}")
    return Scene(field.requires_grad_(False), background, background_kind, step)
