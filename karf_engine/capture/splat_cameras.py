"""The cameras that a splat was learned from, as Kerbl et al. 2023 write them beside it: `cameras.json`, without photos.

A list of objects with width, height, fx, fy, position and rotation; the rotation [3, 3] takes the camera's axes (x right, y
down, z forward) to the world, row by row.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import BadRequest, DataError
from ..io.files import read_json
from .camera import Camera
from .limits import check_camera
from .reading import rigid_pose

NAME = "cameras.json"
# folders in which what belongs to a splat may lie, its own the first: below the model the authors' program makes
# point_cloud/iteration_30000
LEVELS = 3


def folders_around(splat: Path) -> list[Path]:
    """The folder of a splat's file and those above in which its cameras or photos may lie, the nearest first."""
    return list(splat.absolute().parents[:LEVELS])


def cameras_beside(splat: Path) -> list[Path]:
    """The files cameras.json in these folders, the nearest first; any of them may be of something else."""
    return [place for place in (folder / NAME for folder in folders_around(splat)) if place.is_file()]


def read_splat_cameras(path: Path) -> list[Camera]:
    """The cameras of a cameras.json, centered pinholes.

    Raises:
        DataError: The file is damaged, or an entry is no camera; names the file and the entry.
    """
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
