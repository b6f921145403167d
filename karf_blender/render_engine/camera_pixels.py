"""What the engine is asked for one camera, and the arrays of answers."""

import math
from contextlib import suppress
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..engine_api import Camera, camera_to_json, srgb_to_linear
from ..swatches import colors, edits

KIND = "show"


def options_of(scene: bpy.types.Scene, camera: Camera, edited: edits.Edited = colors.edited) -> dict[str, Any]:
    """The query's options: this camera, with the swatches as they stand in the scene, which may be an evaluated one, each
    object's as `edited` says."""
    return {"camera": camera_to_json(camera), "edit": edits.edit_option(scene, edited), "unseen": unseen(scene)}


def unseen(scene: bpy.types.Scene) -> str:
    """What is shown where no photo shows it, as the engine's setting `render.unseen`."""
    return "faded" if scene.karf.fade_unseen else "shown"


def arrays_of(answer: dict[str, Any]) -> dict[str, np.ndarray]:
    """The arrays of an answer by name, read from its file, which is removed; see the engine's queries `show` and
    `harmonics`."""
    path = Path(answer["pixels"])
    try:
        data = path.read_bytes()
    finally:
        with suppress(OSError):
            path.unlink()
    return {
        name: np.frombuffer(data, place["dtype"], math.prod(place["shape"]), place["offset"]).reshape(place["shape"])
        for name, place in answer["arrays"].items()
    }


def combined(arrays: dict[str, np.ndarray]) -> np.ndarray:
    """The picture as Blender wants it: [H, W, 4] float32, scene-linear, alpha premultiplied."""
    color = srgb_to_linear(arrays["color"])
    alpha = arrays.get("alpha", np.ones(color.shape[:2], np.float32))[..., None]
    return np.concatenate([color * alpha, alpha], -1).astype(np.float32)
