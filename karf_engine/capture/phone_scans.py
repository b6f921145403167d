"""Read raw scans of phone apps: Polycam's `keyframes` folder, and Record3D's `metadata` beside its `rgb` photos.

Formats (the apps' exports, as nerfstudio reads them): both have camera_to_world poses in OpenGL axes with y up, which are
turned so that z is up. Polycam writes a JSON for each photo with the pose t_00..t_23 and intrinsics in pixels, and corrected
photos if it has aligned the scan. Record3D writes one JSON with quaternions (x, y, z, w) and positions of all photos.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path, PurePosixPath

import numpy as np

from ..errors import DataError
from ..io.files import read_json
from ..io.matching import find_entry
from .camera import Camera, read_camera
from .capture import Capture
from .posed_photos import PosedPhoto, read_posed
from .reader_utils import rigid_pose, rotation_of_quaternion

Z_UP = np.array([[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])  # of axes with y up
POLYCAM = (("corrected_cameras", "corrected_images"), ("cameras", "images"))
METADATA = ("metadata", "metadata.json")
AGAIN = "Export the scan again."


# -------------------------------------------------------------------------------------------------------------- Polycam
def is_polycam(path: Path) -> bool:
    """Test whether `path` is a folder of Polycam's raw data."""
    return path.is_dir() and bool(_polycam_files(path)[0])


def read_polycam(path: Path, photos: bool) -> Capture:
    """Read the corrected cameras of raw data, else those of the phone. Raises DataError if no photo is found."""
    files, folder = _polycam_files(path)
    posed = [
        PosedPhoto(PurePosixPath(file.stem), partial(_polycam_camera, file), _polycam_size(file)) for file in files
    ]
    return read_posed(path, "polycam", posed, folder, photos, [])


def _polycam_files(folder: Path) -> tuple[list[Path], Path]:
    root = folder / "keyframes" if (folder / "keyframes").is_dir() else folder
    for cameras, images in POLYCAM:
        if (root / images).is_dir() and (files := sorted((root / cameras).glob("*.json"))):
            return files, root / images
    return [], root


def _polycam_size(file: Path) -> tuple[int, int] | None:
    content = read_json(file, "a camera")
    size = (content.get("width"), content.get("height")) if isinstance(content, dict) else (None, None)
    return size if all(isinstance(side, int) and side > 0 for side in size) else None  # type: ignore[return-value]


def _polycam_camera(file: Path, width: int, height: int) -> Camera:
    content = read_json(file, "a camera")
    try:
        rows = [[float(content[f"t_{row}{column}"]) for column in range(4)] for row in range(3)]
        fx, fy, cx, cy = (float(content[name]) for name in ("fx", "fy", "cx", "cy"))
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{file} lacks a value of its camera ({error!r:.100}).", AGAIN) from error
    pose, _ = rigid_pose(Z_UP @ np.vstack([rows, [0, 0, 0, 1.0]]), str(file), "pose")
    return read_camera(str(file), width, height, fx, fy, cx, cy, pose)


# ------------------------------------------------------------------------------------------------------------- Record3D
def is_record3d(path: Path) -> bool:
    """Test whether `path` is a folder that Record3D has exported, or the metadata in one."""
    return path.name in METADATA if path.is_file() else _record3d_root(path) is not None


def read_record3d(path: Path, photos: bool) -> Capture:
    """Read a Record3D export. Raises DataError if its metadata is damaged or no photo is found."""
    root = path.parent if path.is_file() else _record3d_root(path)
    assert root is not None, "is_record3d comes first"
    file = next(each for each in (find_entry(root, name) for name in METADATA) if each.is_file())
    content = read_json(file, "a scan")
    try:
        poses = np.array(content["poses"], np.float64).reshape(-1, 7)
        matrix = np.array(content["K"], np.float64).reshape(3, 3).T
        size = int(content["w"]), int(content["h"])
        shared = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]]
        lenses = np.array(content.get("perFrameIntrinsicCoeffs") or [shared] * len(poses), np.float64)
        lenses = lenses.reshape(len(poses), 4)
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{file} lacks a value of the scan ({error!r:.100}).", AGAIN) from error
    posed = [
        PosedPhoto(PurePosixPath(str(number)), partial(_record3d_camera, f"{file}, pose {number}", pose, lens), size)
        for number, (pose, lens) in enumerate(zip(poses, lenses, strict=True))
    ]
    return read_posed(path, "record3d", posed, root, photos, [])


def _record3d_root(folder: Path) -> Path | None:
    for root in (folder, folder / "EXR_RGBD"):
        if (root / "rgb").is_dir() and any(find_entry(root, name).is_file() for name in METADATA):
            return root
    return None


def _record3d_camera(label: str, pose: np.ndarray, lens: np.ndarray, width: int, height: int) -> Camera:
    x, y, z, w = pose[:4]
    if not np.isfinite(pose).all() or not pose[:4].any():
        raise DataError(f"{label} is not a rotation and position.", AGAIN)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation_of_quaternion(w, x, y, z), pose[4:]
    return read_camera(label, width, height, *lens.tolist(), Z_UP @ matrix)
