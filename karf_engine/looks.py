"""What the field says of captured views, kept in the project: another edit of the same views renders no field again.

    looks/<scene>/<camera>.safetensors   color, depth, opacity and probabilities, as float32, exactly as rendered

`<scene>` stands for what was learned and `<camera>` for the camera, so that a look of anything else is never taken. They
may be deleted. Nothing is kept where the project cannot be written to, or where as much is kept already as may be.
"""

from __future__ import annotations

import hashlib
import json
from contextlib import suppress
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError

from .capture.camera import Camera
from .checkpoints import load_tensors, restoring, save_tensors
from .errors import DataError
from .fields.scene import Picture
from .frames import Frame
from .project import Project

SCHEMA = "karf-look/1"  # another number when the same would be rendered to other pictures
MOST_BYTES = 1 << 30  # of all looks of a project: photos of 800 pixels take 20 MB each


class Looks:
    """The looks of what is learned of a project now."""

    def __init__(self, project: Project) -> None:
        learned = [project.finished(stage) or {} for stage in ("geometry", "segmentation")]
        scene = [[facts.get("fingerprint"), facts.get("files")] for facts in learned]
        self._all = project.looks_folder
        self._folder = self._all / _mark(SCHEMA, scene)

    def find(self, camera: Camera, n_objects: int, device: torch.device) -> Frame | None:
        """The look through this camera; None where it is not kept, or damaged."""
        path = self._path(camera)
        try:
            tensors, _ = load_tensors(path, SCHEMA, device)
            with restoring(path):
                return _frame_of(tensors, n_objects, camera)
        except DataError:
            return None

    def keep(self, camera: Camera, frame: Frame) -> None:
        """Keep a look through this camera; those of what was learned before go."""
        tensors = {name: getattr(frame.picture, name) for name in ("color", "opacity", "depth")}
        with suppress(OSError, SafetensorError):
            self._forget_others()
            new = sum(tensor.nbytes for tensor in tensors.values()) + frame.probabilities.nbytes
            if sum(path.stat().st_size for path in self._folder.glob("*")) + new <= MOST_BYTES:
                tensors["probabilities"] = torch.from_numpy(frame.probabilities)
                save_tensors(self._path(camera), tensors, SCHEMA, {})

    def _forget_others(self) -> None:
        """Remove the looks of what was learned before, and nothing else that may lie there."""
        for path in self._all.glob("*/*.safetensors"):
            if path.parent != self._folder and not path.parent.is_symlink():
                path.unlink()
        for folder in self._all.glob("*/"):
            with suppress(OSError):  # not empty
                folder.rmdir()

    def _path(self, camera: Camera) -> Path:
        pose = camera.camera_to_world.tolist()
        lens = {name: value for name, value in vars(camera).items() if name != "camera_to_world"}
        return self._folder / f"{_mark(pose, lens)}.safetensors"


def _frame_of(tensors: dict[str, torch.Tensor], n_objects: int, camera: Camera) -> Frame:
    """The frame of a file's tensors, which others may have changed. Raises ValueError where they are of no look."""
    size = (camera.height, camera.width)
    shapes = {"color": (*size, 3), "opacity": size, "depth": size, "probabilities": (n_objects, *size)}
    if {name: tuple(tensor.shape) for name, tensor in tensors.items()} != shapes:
        raise ValueError("of another size")
    picture = Picture(tensors["color"], tensors["opacity"], tensors["depth"], None)
    return Frame(picture, tensors["probabilities"].cpu().numpy(), None, picture.color.cpu().numpy())


def _mark(*parts: Any) -> str:
    """A short text that changes when any of the parts does."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()[:16]
