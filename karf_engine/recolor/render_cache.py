"""Renderings and mattes of captured views, kept in the project: another edit of the same views renders no
field and refines no edge again.

    looks/<scene>/<camera>.safetensors   color, depth, opacity and probabilities, as float32, exactly as rendered
    looks/<scene>/<photo>.safetensors    the objects' mattes in a photo, exactly as refined

`<scene>` stands for what was learned, `<camera>` for the camera and `<photo>` for the pixels of photo and look, each 16
hexadecimal digits, so that nothing of anything else is ever taken. Each file holds the checksum of its tensors: a damaged
one is rendered again. They may be deleted. Nothing is kept where the project cannot be written to, or where as much is
kept already as may be.
"""

from __future__ import annotations

import hashlib
import json
import re
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors import SafetensorError

from ..capture.camera import Camera
from ..errors import DataError
from ..fields.scene import Picture
from ..io.checkpoints import load_tensors, restoring, save_tensors
from ..io.containment import is_link
from ..project import Project
from .frames import Frame
from .matting.marks import Marks
from .matting.matte import Matte
from .matting.refine import mattes_of

SCHEMA = "karf-look/2"  # the number goes up when the same inputs would be rendered to other pictures
MATTES = "karf-mattes/3"  # the number goes up when the same inputs would be refined to other mattes
MARK = re.compile("[0-9a-f]{16}")  # names of folders here, and of files before their ending
MOST_BYTES = 1 << 30  # size of a project's cache: photos of 800 pixels take 20 MB each


class RenderCache:
    """The cached renderings of what is learned of a project now."""

    def __init__(self, project: Project) -> None:
        learned = [project.finished(stage) or {} for stage in ("geometry", "segmentation")]
        scene = [[facts.get("fingerprint"), facts.get("files")] for facts in learned]
        self._project = project
        self._folder = project.path(project.looks_folder.name, _mark(SCHEMA, scene))

    def find(self, camera: Camera, n_objects: int, device: torch.device) -> Frame | None:
        """The look through this camera; None where it is not kept, or damaged."""
        path = self._path(camera)
        try:
            tensors, _ = _load(path, SCHEMA)
            with restoring(path):
                return _frame_of({name: tensor.to(device) for name, tensor in tensors.items()}, n_objects, camera)
        except DataError:
            return None

    def keep(self, camera: Camera, frame: Frame) -> None:
        """Keep a look through this camera; those of what was learned before go."""
        tensors = {name: getattr(frame.picture, name) for name in ("color", "opacity", "depth")}
        tensors["probabilities"] = torch.from_numpy(frame.probabilities)
        self._keep(self._path(camera), tensors, SCHEMA, {})

    def mattes(
        self,
        edges: str,
        photo: np.ndarray,
        probabilities: np.ndarray,
        rendered: np.ndarray,
        marks: Marks,
        seed: int,
    ) -> list[Matte]:
        """What `recolor.matting.refine.mattes_of` gives for the same arguments; refined ones are taken where they are kept.

        The seed must be the one that the scene was learned with: kept mattes belong to one scene.
        """
        if edges == "field":  # as quick to make as to read
            return mattes_of(edges, photo, probabilities, rendered, marks, seed)
        arrays = [np.ascontiguousarray(array) for array in (photo, probabilities, rendered)]
        drawn = [] if marks.drawn is None else [np.ascontiguousarray(marks.drawn)]
        contents = [[array.shape, array.dtype.str, hashlib.sha256(array).hexdigest()] for array in arrays + drawn]
        path = self._file(_mark(MATTES, edges, contents, marks.thin))
        known = _read_mattes(path, len(probabilities))
        if known is None:
            known = mattes_of(edges, *arrays, marks, seed)
            self._keep(path, *_tensors_of(known))
        return known

    def _keep(self, path: Path, tensors: dict[str, torch.Tensor], schema: str, facts: dict[str, Any]) -> None:
        """Write a file where there is room; those of what was learned before go."""
        if not self._project.state_file.exists():  # deleted meanwhile
            return
        with suppress(OSError, SafetensorError):
            self._forget_others()
            new = sum(tensor.nbytes for tensor in tensors.values())
            if sum(path.lstat().st_size for path in self._folder.glob("*")) + new <= MOST_BYTES:
                save_tensors(path, tensors, schema, facts | {"checksum": _checksum(tensors)})

    def _forget_others(self) -> None:
        """Remove the renderings of what was learned before, and nothing else that may lie there."""
        for folder in self._folder.parent.glob("*/"):
            if folder == self._folder or not MARK.fullmatch(folder.name) or is_link(folder):
                continue
            for path in folder.glob("*.safetensors"):
                if MARK.fullmatch(path.stem):
                    path.unlink()
            with suppress(OSError):  # not empty
                folder.rmdir()

    def _path(self, camera: Camera) -> Path:
        pose = camera.camera_to_world.tolist()
        lens = {name: value for name, value in vars(camera).items() if name != "camera_to_world"}
        return self._file(_mark(pose, lens))

    def _file(self, mark: str) -> Path:
        return self._project.path(*self._folder.relative_to(self._project.folder).parts, f"{mark}.safetensors")


def _load(path: Path, schema: str) -> tuple[dict[str, torch.Tensor], dict[str, Any]]:
    """The tensors and facts of a file. Raises DataError where it is missing, or not as it was written."""
    tensors, facts = load_tensors(path, schema)
    with restoring(path):
        if facts["checksum"] != _checksum(tensors):
            raise ValueError("its checksum differs")
    return tensors, facts


def _checksum(tensors: dict[str, torch.Tensor]) -> str:
    digest = hashlib.sha256()
    for name in sorted(tensors):
        array = tensors[name].detach().cpu().contiguous().numpy()
        digest.update(f"{name} {array.dtype} {array.shape}".encode())
        digest.update(array)
    return digest.hexdigest()


def _frame_of(tensors: dict[str, torch.Tensor], n_objects: int, camera: Camera) -> Frame:
    """The frame of a file's tensors, which others may have changed. Raises ValueError where they are of no look."""
    size = (camera.height, camera.width)
    shapes = {"color": (*size, 3), "opacity": size, "depth": size, "probabilities": (n_objects, *size)}
    if {name: tuple(tensor.shape) for name, tensor in tensors.items()} != shapes:
        raise ValueError("of another size")
    picture = Picture(tensors["color"], tensors["opacity"], tensors["depth"], None)
    return Frame(picture, tensors["probabilities"].cpu().numpy(), None, picture.color.cpu().numpy())


def _tensors_of(mattes: list[Matte]) -> tuple[dict[str, torch.Tensor], str, dict[str, Any]]:
    """What a file of mattes holds: tensors, schema, facts."""
    tensors = {
        f"{k}.{name}": torch.from_numpy(np.ascontiguousarray(getattr(matte, name)))
        for k, matte in enumerate(mattes)
        for name in ("coverage", "mixed", "mixed_colors")
    }
    places = [[matte.rows, matte.columns, matte.disputed] for matte in mattes]
    return tensors, MATTES, {"places": places}


def _read_mattes(path: Path, n_objects: int) -> list[Matte] | None:
    """The mattes of a file; None where it is not there, or damaged."""
    try:
        tensors, facts = _load(path, MATTES)
        with restoring(path):
            places = facts["places"]
            if len(places) != n_objects:
                raise ValueError("of other objects")
            return [_matte_of(tensors, k, *place) for k, place in enumerate(places)]
    except DataError:
        return None


def _matte_of(tensors: dict[str, torch.Tensor], k: int, rows: list[int], columns: list[int], disputed: bool) -> Matte:
    """A matte of a file's tensors, which others may have changed. Raises ValueError where they make none."""
    coverage, mixed, colors = (tensors[f"{k}.{name}"].numpy() for name in ("coverage", "mixed", "mixed_colors"))
    box = (rows[1] - rows[0], columns[1] - columns[0])
    within = not len(mixed) or 0 <= mixed.min() <= mixed.max() < coverage.size
    if coverage.shape != box or not within or colors.shape != (len(mixed), 3) or colors.dtype != np.uint8:
        raise ValueError("of another size")
    return Matte(tuple(rows), tuple(columns), coverage, mixed, colors, disputed)


def _mark(*parts: Any) -> str:
    """A short text that changes when any of the parts does."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()[:16]
