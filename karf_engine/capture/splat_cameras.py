"""Read the training cameras that Kerbl et al. 2023 write beside splats: `cameras.json`, without photos.

A list of objects with width, height, fx, fy, position and rotation; the row-major rotation [3, 3] maps the camera's axes
(x right, y down, z forward) to the world.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import BadRequest, DataError
from ..io.files import read_json
from .camera import Camera, check_camera
from .reader_utils import rigid_pose

NAME = "cameras.json"
LEVELS = 3  # the reference implementation writes splats to MODEL/point_cloud/iteration_30000


def folders_around(splat: Path) -> list[Path]:
    """Return the folders that may contain the cameras or photos of a splat file, nearest first."""
    return list(splat.absolute().parents[:LEVELS])


def cameras_beside(splat: Path) -> list[Path]:
    """Return the files cameras.json around a splat file, nearest first; they may belong to something else."""
    return [path for path in (folder / NAME for folder in folders_around(splat)) if path.is_file()]


def read_splat_cameras(path: Path) -> list[Camera]:
    """Read the cameras of a cameras.json, centered pinholes. Raises DataError if the file or an entry is damaged."""
    content = read_json(path, "cameras")
    if not isinstance(content, list) or not content:
        raise DataError(f"{path} holds no list of cameras.", "Give the cameras.json that was written with the splat.")
    return [_camera(entry, f"{path}, camera {number}") for number, entry in enumerate(content)]


def _camera(entry: Any, label: str) -> Camera:
    try:
        width, height = int(entry["width"]), int(entry["height"])
        fx, fy = float(entry["fx"]), float(entry["fy"])
        pose = np.eye(4)
        pose[:3, :3] = np.array(entry["rotation"], np.float64).reshape(3, 3) @ np.diag([1.0, -1, -1])
        pose[:3, 3] = np.array(entry["position"], np.float64).reshape(3)
        camera = Camera(width, height, fx, fy, width / 2, height / 2, pose)
    except (KeyError, TypeError, ValueError, OverflowError, BadRequest) as error:
        raise DataError(f"{label} is no camera ({error!r:.200}).", "Write the cameras again.") from error
    pose, _ = rigid_pose(pose, label, "rotation")
    return check_camera(replace(camera, camera_to_world=pose), label, "Write the cameras again.")
