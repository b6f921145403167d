"""Read OpenSfM and OpenDroneMap reconstructions: `reconstruction.json` with photos in `images`.

Format (OpenSfM's documentation, "Reconstruction file format" and "Camera models"): poses are world to camera, an axis and
angle in one vector and a translation, in axes x right, y down, z forward. Lengths on the image are relative to its longer
side, from its center. Spherical cameras: see `Panorama`.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from ..errors import DataError
from ..io.files import read_json
from ..io.matching import find_entry
from .camera import LARGEST_POSITION, Camera, Panorama, read_camera
from .capture import Capture
from .posed_photos import PosedPhoto, read_posed
from .reader_utils import opencv_distortion, pose_of_opencv, rotation_of_vector

FILE = "reconstruction.json"
FOLDERS = ("", "opensfm")
PERSPECTIVE = ("perspective", "simple_radial", "radial", "brown")
FISHEYE = ("fisheye", "fisheye_opencv")
SPHERICAL = ("spherical", "equirectangular")


def is_opensfm(path: Path) -> bool:
    """Test whether `path` is a reconstruction.json, or a folder of OpenSfM or OpenDroneMap with one."""
    return path.name.lower() == FILE if path.is_file() else _file(path) is not None


def read_opensfm(path: Path, photos: bool) -> Capture:
    """Read the largest reconstruction of a file. Raises DataError if it is damaged or no photo is found."""
    file = path if path.is_file() else _file(path)
    assert file is not None, "is_opensfm comes first"
    content = read_json(file, "a reconstruction")
    parts = [part for part in content if isinstance(part, dict)] if isinstance(content, list) else []
    best = max(parts, key=lambda part: len(_table(part, "shots")), default={})
    shots, cameras = _table(best, "shots"), _table(best, "cameras")
    if not shots:
        raise DataError(f"{file} holds no reconstruction with shots.", "Run OpenSfM's reconstruct again.")
    remarks = [f"{len(parts)} reconstructions were found; that of the most photos was read."] if len(parts) > 1 else []
    posed = [
        PosedPhoto(PurePosixPath(name), partial(_camera, f"{file}, shot {name!r}", shot, cameras), _size(shot, cameras))
        for name, shot in sorted(shots.items())
    ]
    folder = file.parent.parent if file.parent.name == "opensfm" else file.parent
    return read_posed(path, "opensfm", posed, folder, photos, remarks)


def _file(folder: Path) -> Path | None:
    return next((file for name in FOLDERS if (file := find_entry(folder / name, FILE)).is_file()), None)


def _table(part: dict, name: str) -> dict[str, Any]:
    table = part.get(name)
    return table if isinstance(table, dict) else {}


def _size(shot: Any, cameras: dict[str, Any]) -> tuple[int, int] | None:
    try:
        lens = cameras[shot["camera"]]
        return int(lens["width"]), int(lens["height"])
    except (KeyError, TypeError, ValueError):
        return None


def _camera(label: str, shot: Any, cameras: dict[str, Any], width: int, height: int) -> Camera:
    try:
        lens = cameras[shot["camera"]]
        kind, side = lens.get("projection_type", "perspective"), max(width, height)
        pose = _pose(label, shot)
        if kind in SPHERICAL:
            return Panorama.of(label, width, height, pose)
        if kind not in PERSPECTIVE + FISHEYE:
            raise DataError(f"{label} has a {kind} camera, which cannot be read.", "Export it with pinhole cameras.")
        fx = float(lens.get("focal_x", lens.get("focal"))) * side
        fy = float(lens.get("focal_y", lens.get("focal"))) * side
        cx, cy = (float(lens.get(name, 0)) * side + length / 2 for name, length in (("c_x", width), ("c_y", height)))
        keys = ("k1", "k2", "k3", "k4") if kind in FISHEYE else ("k1", "k2", "k3", "p1", "p2")
        distortion = opencv_distortion({key: float(lens.get(key, 0)) for key in keys}, kind in FISHEYE)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise DataError(f"{label} or its camera lacks a value ({error!r:.100}).", "Export it again.") from error
    return read_camera(label, width, height, fx, fy, cx, cy, pose, distortion, kind in FISHEYE)


def _pose(label: str, shot: dict[str, Any]) -> np.ndarray:
    vector, translation = np.array(shot["rotation"], np.float64), np.array(shot["translation"], np.float64)
    if vector.shape != (3,) or translation.shape != (3,) or not np.abs([vector, translation]).max() <= LARGEST_POSITION:
        raise DataError(f"{label} has a pose that is not a rotation and position.", "Leave this photo out.")
    return pose_of_opencv(rotation_of_vector(vector), translation)
