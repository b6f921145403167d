"""Cache of field renderings and mattes of captured views, in the project's folder.

    looks/<scene>/
        <camera>.safetensors   color, depth, opacity and probabilities, float32
        <photo>.safetensors    the objects' mattes in a photo

`<scene>` is a hash of what was learned, `<camera>` of the camera and `<photo>` of the matting's inputs, each 16
hexadecimal digits. A file whose checksum differs is made again. Files may be deleted at any time. Nothing is written to a
read-only project, or beyond `MOST_BYTES`.
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
from ..io.checkpoints import damage_as_data_error, load_tensors, save_tensors
from ..io.containment import is_link
from ..project import Project
from .field_rendering import Learned, segmented_frame
from .frames import Frame
from .matting.matte import Matte
from .matting.photo_mattes import make_mattes
from .matting.thin_parts import Marks

SCHEMA = "karf-look/2"  # raise the number when renderings change
MATTES = "karf-mattes/3"  # raise the number when mattes change
HASH = re.compile("[0-9a-f]{16}")  # names of the cache's folders and files
MOST_BYTES = 1 << 30  # per project: photos of 800 pixels take 20 MB each


class RenderCache:
    """Renderings and mattes of what a project has learned."""

    def __init__(self, project: Project) -> None:
        learned = [project.finished(stage) or {} for stage in ("geometry", "segmentation")]
        scene = [[facts.get("fingerprint"), facts.get("files")] for facts in learned]
        self._project = project
        self._folder = project.path(project.render_cache_folder.name, _hash(SCHEMA, scene))
        self._last: tuple[Camera, Frame] | None = None

    def frame(self, camera: Camera, learned: Learned) -> Frame:
        """Return `segmented_frame` of a camera, from memory or disk if it is known."""
        if self._last is None or self._last[0] != camera:
            frame = self._read_frame(camera, learned.device)
            if frame is None:
                frame = segmented_frame(learned, camera)
                tensors = {name: getattr(frame.picture, name) for name in ("color", "opacity", "depth")}
                tensors["probabilities"] = torch.from_numpy(frame.probabilities)
                self._write(self._camera_file(camera), tensors, SCHEMA, {})
            self._last = camera, frame
        return self._last[1]

    def _read_frame(self, camera: Camera, device: torch.device) -> Frame | None:
        try:
            tensors, _ = _load(self._camera_file(camera), SCHEMA)
        except DataError:
            return None
        color, opacity, depth = (tensors[name].to(device) for name in ("color", "opacity", "depth"))
        picture = Picture(color, opacity, depth, None)
        return Frame(picture, tensors["probabilities"].numpy(), None, picture.color.cpu().numpy())

    def mattes(
        self, edges: str, photo: np.ndarray, probabilities: np.ndarray, rendered: np.ndarray, marks: Marks, seed: int
    ) -> list[Matte]:
        """Return `make_mattes` of these arguments, from disk if they are known.

        The seed must be that of the learned scene: it is not part of the file's name.
        """
        if edges == "field":  # as fast to compute as to read
            return make_mattes(edges, photo, probabilities, rendered, marks, seed)
        arrays = [np.ascontiguousarray(array) for array in (photo, probabilities, rendered)]
        drawn = [] if marks.drawn is None else [np.ascontiguousarray(marks.drawn)]
        contents = [[array.shape, array.dtype.str, hashlib.sha256(array.data).hexdigest()] for array in arrays + drawn]
        path = self._file(_hash(MATTES, edges, contents, marks.thin))
        mattes = _read_mattes(path, len(probabilities))
        if mattes is None:
            photo, probabilities, rendered = arrays
            mattes = make_mattes(edges, photo, probabilities, rendered, marks, seed)
            boxes = [[matte.rows, matte.columns, matte.disputed] for matte in mattes]
            tensors = {
                f"{k}.{name}": torch.from_numpy(np.ascontiguousarray(getattr(matte, name)))
                for k, matte in enumerate(mattes)
                for name in ("coverage", "mixed", "mixed_colors")
            }
            self._write(path, tensors, MATTES, {"places": boxes})
        return mattes

    def _write(self, path: Path, tensors: dict[str, torch.Tensor], schema: str, facts: dict[str, Any]) -> None:
        if not self._project.state_file.exists():  # deleted meanwhile
            return
        with suppress(OSError, SafetensorError):
            self._remove_outdated()
            new = sum(tensor.nbytes for tensor in tensors.values())
            if sum(path.lstat().st_size for path in self._folder.glob("*")) + new <= MOST_BYTES:
                save_tensors(path, tensors, schema, facts | {"checksum": _checksum(tensors)})

    def _remove_outdated(self) -> None:
        for folder in self._folder.parent.glob("*/"):
            if folder == self._folder or not HASH.fullmatch(folder.name) or is_link(folder):
                continue
            for path in folder.glob("*.safetensors"):
                if HASH.fullmatch(path.stem):
                    path.unlink()
            with suppress(OSError):  # not empty
                folder.rmdir()

    def _camera_file(self, camera: Camera) -> Path:
        pose = camera.camera_to_world.tolist()
        lens = {name: value for name, value in vars(camera).items() if name != "camera_to_world"}
        return self._file(_hash(pose, lens))

    def _file(self, name: str) -> Path:
        return self._project.path(*self._folder.relative_to(self._project.folder).parts, f"{name}.safetensors")


def _load(path: Path, schema: str) -> tuple[dict[str, torch.Tensor], dict[str, Any]]:
    tensors, facts = load_tensors(path, schema)
    with damage_as_data_error(path):
        if facts["checksum"] != _checksum(tensors):
            raise ValueError("its checksum differs")
    return tensors, facts


def _checksum(tensors: dict[str, torch.Tensor]) -> str:
    digest = hashlib.sha256()
    for name in sorted(tensors):
        array = tensors[name].detach().cpu().contiguous().numpy()
        digest.update(f"{name} {array.dtype} {array.shape}".encode())
        digest.update(array.data)
    return digest.hexdigest()


def _read_mattes(path: Path, n_objects: int) -> list[Matte] | None:
    """Read mattes; None if the file is missing or damaged."""
    try:
        tensors, facts = _load(path, MATTES)
        with damage_as_data_error(path):
            boxes = facts["places"]
            if len(boxes) != n_objects:
                raise ValueError("of other objects")
            return [_matte_of(tensors, k, *box) for k, box in enumerate(boxes)]
    except DataError:
        return None


def _matte_of(tensors: dict[str, torch.Tensor], k: int, rows: list[int], columns: list[int], disputed: bool) -> Matte:
    coverage, mixed, colors = (tensors[f"{k}.{name}"].numpy() for name in ("coverage", "mixed", "mixed_colors"))
    box = (rows[1] - rows[0], columns[1] - columns[0])
    within = not len(mixed) or 0 <= mixed.min() <= mixed.max() < coverage.size
    if coverage.shape != box or not within or colors.shape != (len(mixed), 3) or colors.dtype != np.uint8:
        raise ValueError("of another size")
    return Matte((rows[0], rows[1]), (columns[0], columns[1]), coverage, mixed, colors, disputed)


def _hash(*parts: Any) -> str:
    return hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()[:16]
