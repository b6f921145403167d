"""The engine's query for one camera, and the arrays of its answer."""

import math
from contextlib import suppress
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..engine_api import Camera, camera_to_json
from ..swatches import colors, edits

KIND = "show"


def options_of(scene: bpy.types.Scene, camera: Camera, edited: edits.Edited = colors.edited) -> dict[str, Any]:
    """Return the query's options for a camera and a scene, also an evaluated one; `edited` gives an object's palette."""
    return {"camera": camera_to_json(camera), "edit": edits.edit_option(scene, edited), "unseen": unseen(scene)}


def unseen(scene: bpy.types.Scene) -> str:
    """Return the engine's setting `render.unseen` for places that no photo shows."""
    return "faded" if scene.karf.fade_unseen else "shown"


def arrays_of(answer: dict[str, Any]) -> dict[str, np.ndarray]:
    """Return the arrays of an answer to the queries `show` and `harmonics`, and remove the answer's file."""
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
