"""Read the frames of a `transforms*.json` and their cameras. Formats: see `transforms_json`."""

from __future__ import annotations

import math
from collections import ChainMap
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from ..errors import DataError
from ..io.files import read_json
from .camera import LARGEST_SIDE, Camera, check_camera, read_camera
from .capture import SPLITS
from .reader_utils import LENS_KEYS, at_size, opencv_distortion, photo_size, rigid_pose

PERSPECTIVE = ("PERSPECTIVE", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV")
FISHEYE = ("OPENCV_FISHEYE", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE")


@dataclass(frozen=True)
class Frame:
    """One entry of `frames`.

    Attributes:
        file: The JSON file.
        index: Index in `frames`.
        parts: Path components of its `file_path`.
        fields: Its fields, which override the file's global fields.
        split: `train`, `val` or `test`; empty if the file declares none.
    """

    file: Path
    index: int
    parts: tuple[str, ...]
    fields: Mapping[str, Any]
    split: str

    @property
    def label(self) -> str:
        """Name of the frame in messages."""
        return f"{self.file}, frame {self.index} ({self.fields['file_path']!r:.200})"


def read_frames(file: Path, split: str) -> list[Frame]:
    """Read all frames of a transforms file; an empty `split` means those that the file declares.

    Raises:
        DataError: The file is not a JSON object with a list of frames, or a frame has no file_path.
    """
    content = read_json(file, "cameras")
    if not isinstance(content, dict):
        raise DataError(f"{file} holds a JSON {type(content).__name__}, not an object.", "Give a transforms.json file.")
    entries = content.get("frames")
    if not isinstance(entries, list) or not entries:
        raise DataError(f"{file} has no list of frames.", "Give a transforms.json file with at least one frame.")
    shared = {key: value for key, value in content.items() if key != "frames"}
    declared = _declared_splits(shared)
    return [_frame(file, index, entry, shared, split, declared) for index, entry in enumerate(entries)]


def _declared_splits(shared: dict[str, Any]) -> dict[str, str]:
    """Return the split by file path, from nerfstudio's train_filenames, val_filenames and test_filenames."""
    lists = {split: shared.get(f"{split}_filenames") for split in SPLITS}
    return {str(name): split for split, names in lists.items() if isinstance(names, list) for name in names}


def _frame(file: Path, index: int, entry: Any, shared: dict[str, Any], split: str, declared: dict[str, str]) -> Frame:
    file_path = entry.get("file_path") if isinstance(entry, dict) else None
    path = PurePosixPath(file_path.replace("\\", "/")) if isinstance(file_path, str) else PurePosixPath()
    if not isinstance(file_path, str) or not path.name:
        raise DataError(f"{file}, frame {index} has no file_path.", "Write the photo's path into the frame.")
    return Frame(file, index, path.parts, ChainMap(entry, shared), split or declared.get(file_path, ""))


# -------------------------------------------------------------------------------------------------------------- cameras
def camera_of(frame: Frame, image: Path | None) -> tuple[Camera, list[str]]:
    """Return the camera of a frame at its photo's size (without one, the declared size), and notes on changes.

    Raises:
        DataError: A number is missing, out of range or of another type, or the camera model is unknown.
    """
    fisheye = _is_fisheye(frame)
    declared = _declared_size(frame)
    size = photo_size(image, declared) if image else declared
    if size is None:
        raise DataError(f"{frame.label} declares no picture size.", "Write w and h into the file.")
    width, height = declared or size
    fx, fy = _focal_lengths(frame, width, height)
    camera_to_world, pose_notes = _pose(frame)
    camera = read_camera(
        frame.label,
        "Correct it in the file.",
        width=width,
        height=height,
        fx=fx,
        fy=fy,
        cx=_number_or(frame, "cx", width / 2),
        cy=_number_or(frame, "cy", height / 2),
        camera_to_world=camera_to_world,
        distortion=opencv_distortion({key: _number_or(frame, key, 0.0) for key in LENS_KEYS}, fisheye),
        fisheye=fisheye,
    )
    camera, size_notes = at_size(camera, size)
    return check_camera(camera, frame.label, "Correct it in the file."), size_notes + pose_notes


def camera_from_json(fields: Any, source: str) -> Camera:
    """Read a bare camera from a frame with a size; `source` names it in messages. Raises DataError as `camera_of`."""
    if not isinstance(fields, dict):
        raise DataError(f"{source} has a JSON {type(fields).__name__} for a camera.", "Give an object.")
    return camera_of(Frame(Path(source), 0, (), {"file_path": "camera", **fields}, ""), None)[0]


def _is_fisheye(frame: Frame) -> bool:
    model = frame.fields.get("camera_model") or ("OPENCV_FISHEYE" if frame.fields.get("is_fisheye") else "OPENCV")
    if model not in PERSPECTIVE + FISHEYE:
        raise DataError(f"{frame.label} has a {model!s:.200} camera, which cannot be read.", "Undistort the photos.")
    return model in FISHEYE or bool(frame.fields.get("is_fisheye"))


def _declared_size(frame: Frame) -> tuple[int, int] | None:
    width, height = _positive(frame, "w"), _positive(frame, "h")
    if not (width and height):
        return None
    if max(width, height) > LARGEST_SIDE:
        raise DataError(f"{frame.label} declares {width:g}x{height:g} pixels.", "Correct w and h in the file.")
    return max(1, round(width)), max(1, round(height))


def _focal_lengths(frame: Frame, width: int, height: int) -> tuple[float, float]:
    fx = _positive(frame, "fl_x") or _focal_from_angle(frame, "camera_angle_x", width)
    fy = _positive(frame, "fl_y") or _focal_from_angle(frame, "camera_angle_y", height)
    if fx is None:
        fx = fy
    if fx is None:
        raise DataError(f"{frame.label} has neither fl_x nor camera_angle_x.", "Write the focal length into the file.")
    return fx, fx if fy is None else fy


def _focal_from_angle(frame: Frame, key: str, extent: int) -> float | None:
    """Convert a full field of view in radians to a focal length in pixels: f = extent / 2 / tan(angle / 2)."""
    angle = _positive(frame, key)
    if angle is None:
        return None
    if angle >= math.pi:
        raise DataError(f"{frame.label} has {key} = {angle:g}, beyond pi.", "Field of view is given in radians.")
    return extent / 2 / math.tan(angle / 2)


def _pose(frame: Frame) -> tuple[np.ndarray, list[str]]:
    """Return camera_to_world [4, 4] and notes, see `rigid_pose`."""
    try:
        matrix = np.array(frame.fields.get("transform_matrix"), np.float64)
    except (TypeError, ValueError, OverflowError):
        matrix = np.empty(0)
    if matrix.shape == (3, 4):
        matrix = np.vstack([matrix, [0.0, 0.0, 0.0, 1.0]])
    if matrix.shape != (4, 4):
        raise DataError(f"{frame.label} has no 4x4 transform_matrix of numbers.", "Export the cameras again.")
    return rigid_pose(matrix, frame.label, "transform_matrix")


def _number_or(frame: Frame, key: str, default: float) -> float:
    value = _number(frame, key)
    return default if value is None else value


def _number(frame: Frame, key: str) -> float | None:
    value = frame.fields.get(key)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e300:
        raise DataError(f"{frame.label} has {key} = {value!r:.200}, which is not a number.", "Correct it in the file.")
    return float(value)


def _positive(frame: Frame, key: str) -> float | None:
    value = _number(frame, key)
    if value is not None and value <= 0:
        raise DataError(f"{frame.label} has {key} = {value:g}, which must be positive.", "Correct it in the file.")
    return value
