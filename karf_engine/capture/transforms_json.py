"""Cameras in `transforms*.json`: NeRF-synthetic captures, instant-ngp and nerfstudio files, and camera files of ours.

Formats: the Blender script of NeRF (Mildenhall et al. 2020), instant-ngp's docs/nerf_dataset_tips.md and nerfstudio's
data conventions. All use OpenGL axes and pixel corners at integers, as `Camera` does; k1..k6 p1 p2 are OpenCV's, and of
its fisheye model where `camera_model` or `is_fisheye` says so. nerfstudio's `applied_transform` has been applied to the
poses and to the points of `ply_file_path` alike, so it changes nothing here; nor do fields that only steer training.
A `file_path` is relative to the JSON's folder; in the wild it also lacks its extension, is an absolute path of another
machine, or leaves out the folder that the photos were moved to.
"""

from __future__ import annotations

import math
from collections import ChainMap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from ..errors import DataError
from ..files import read_json, write_json
from .camera import Camera
from .capture import SPLITS, Capture, SparsePoints, View, with_test_views
from .limits import LARGEST_SIDE, check_camera
from .ply import read_points
from .reading import (
    FISHEYE_KEYS,
    LENS_KEYS,
    PHOTO_SUFFIXES,
    at_size,
    counted,
    exists,
    lens,
    make_views,
    photo_size,
    rigid_pose,
)

SYNTHETIC_FILES = {f"transforms_{split}.json": split for split in SPLITS}
PERSPECTIVE = ("PERSPECTIVE", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV")
MOST_PARTS = 32  # of a photo's path that are looked for elsewhere
FISHEYE = ("OPENCV_FISHEYE", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE")


@dataclass(frozen=True)
class _Frame:
    """One entry of `frames`: global fields overlaid by its own. split is empty where the file declares none."""

    file: Path
    index: int
    parts: tuple[str, ...]
    fields: Mapping[str, Any]
    split: str

    @property
    def label(self) -> str:
        return f"{self.file}, frame {self.index} ({self.fields['file_path']!r:.200})"


# ------------------------------------------------------------------------------------------------------------ entrances
def is_nerf_synthetic(path: Path) -> bool:
    """Whether `path` is a folder with transforms_train.json, or one of the split files beside it."""
    folder = path if path.is_dir() else path.parent if path.name in SYNTHETIC_FILES else None
    return folder is not None and (folder / "transforms_train.json").is_file()


def is_transforms(path: Path) -> bool:
    """Whether `path` is a folder with transforms.json, or any JSON file."""
    return (path / "transforms.json").is_file() or (path.is_file() and path.suffix.lower() == ".json")


def read_nerf_synthetic(path: Path, photos: bool) -> Capture:
    """Read the splits of a NeRF-synthetic folder; without photos, one split's file is read alone.

    Without transforms_test.json, every 8th training view becomes a test view. Raises DataError naming file and frame.
    """
    if path.is_file() and not photos:
        return read_transforms(path, photos)
    folder = path if path.is_dir() else path.parent
    files = [(folder / name, split) for name, split in SYNTHETIC_FILES.items() if (folder / name).is_file()]
    return _read(path, "nerf-synthetic", files, photos)


def read_transforms(path: Path, photos: bool) -> Capture:
    """Read one transforms file (or the transforms.json of a folder). Raises DataError naming file and frame.

    photos=True: frames without a photo are skipped with a remark, sizes are those of the photos, and every 8th view
    becomes a test view where the file declares none. photos=False: bare cameras, whose sizes must be in the file.
    """
    file = path if path.is_file() else path / "transforms.json"
    return _read(path, "transforms", [(file, SYNTHETIC_FILES.get(file.name, ""))], photos)


def write_cameras(path: Path, views: Sequence[View]) -> None:
    """Write bare cameras as an instant-ngp style file; `open_capture(path, photos=False)` gives them back exactly."""
    content = {
        "camera_model": "OPENCV",
        "frames": [_frame_to_json(view) for view in views],
        **{f"{split}_filenames": [view.name for view in views if view.split == split] for split in SPLITS},
    }
    write_json(path, content)


def _frame_to_json(view: View) -> dict[str, Any]:
    camera = view.camera
    keys = FISHEYE_KEYS if camera.fisheye else LENS_KEYS
    return {
        "file_path": view.name,
        **({"camera_model": "OPENCV_FISHEYE"} if camera.fisheye else {}),
        "w": camera.width,
        "h": camera.height,
        "fl_x": float(camera.fx),
        "fl_y": float(camera.fy),
        "cx": float(camera.cx),
        "cy": float(camera.cy),
        **dict(zip(keys, map(float, camera.distortion), strict=False)),
        "transform_matrix": camera.camera_to_world.tolist(),
    }


def _read(source: Path, format_name: str, files: list[tuple[Path, str]], photos: bool) -> Capture:
    per_file = [_frames(file, split) for file, split in files]
    frames = [frame for group in per_file for frame in group]
    if not photos:
        return Capture(source.absolute(), format_name, tuple(_views([(frame, None) for frame in frames])[0]))
    points, remarks_of_points = _points(frames[0])
    images = [image for group in per_file for image in _find_photos(group)]
    found = [(frame, image) for frame, image in zip(frames, images, strict=True) if image]
    missing = [frame for frame, image in zip(frames, images, strict=True) if not image]
    if not found:
        first = ", ".join(f"{frame.fields['file_path']:.200}" for frame in missing[:3])
        raise DataError(
            f"{source}: none of its {len(missing)} photos was found, the first are {first}.",
            f"Put the photos below {frames[0].file.parent}, or write each file_path relative to that folder.",
        )
    views, remarks = _views(found)
    if missing:
        first = missing[0].fields["file_path"][:200]
        remarks.insert(0, f"{len(missing)} of {len(frames)} photos are missing and were skipped; the first is {first}.")
    if not any(view.split == "test" for view in views):
        rest = iter(with_test_views([view for view in views if view.split == "train"]))
        views = [next(rest) if view.split == "train" else view for view in views]
    return Capture(source.absolute(), format_name, tuple(views), tuple(remarks + remarks_of_points), points)


def _points(frame: _Frame) -> tuple[SparsePoints | None, list[str]]:
    """The points of nerfstudio's `ply_file_path`, and a remark where the file is missing."""
    name = frame.fields.get("ply_file_path")
    if not isinstance(name, str) or not name:
        return None, []
    path = frame.file.parent.joinpath(*PurePosixPath(name.replace("\\", "/")).parts)
    if not exists(path):
        return None, [f"Its sparse points {name} are missing; there are none without them."]
    points = read_points(path)
    return points if len(points) else None, []


def _views(found: list[tuple[_Frame, Path | None]]) -> tuple[list[View], list[str]]:
    """Views in frame order, and what was noted about their cameras with the number of views it holds for."""
    cameras = [_camera(frame, image) for frame, image in found]
    images = [image for _, image in found]
    stems = [_stem(frame, image) for frame, image in found]
    splits = [frame.split or "train" for frame, _ in found]
    views = make_views([camera for camera, _ in cameras], images, stems, splits)
    return views, counted(note for _, notes in cameras for note in notes)


# --------------------------------------------------------------------------------------------------------------- frames
def _frames(file: Path, split: str) -> list[_Frame]:
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
    """File path -> split, of nerfstudio's train_filenames, val_filenames and test_filenames."""
    lists = {split: shared.get(f"{split}_filenames") for split in SPLITS}
    return {str(name): split for split, names in lists.items() if isinstance(names, list) for name in names}


def _frame(file: Path, index: int, entry: Any, shared: dict[str, Any], split: str, declared: dict[str, str]) -> _Frame:
    file_path = entry.get("file_path") if isinstance(entry, dict) else None
    path = PurePosixPath(file_path.replace("\\", "/")) if isinstance(file_path, str) else PurePosixPath()
    if not path.name:
        raise DataError(f"{file}, frame {index} has no file_path.", "Write the photo's path into the frame.")
    return _Frame(file, index, path.parts, ChainMap(entry, shared), split or declared.get(file_path, ""))


def _stem(frame: _Frame, image: Path | None) -> str:
    if image:
        return image.stem
    name = PurePosixPath(frame.parts[-1])
    return name.stem if name.suffix.lower() in PHOTO_SUFFIXES else name.name


def _find_photos(frames: list[_Frame]) -> list[Path | None]:
    """The photo of each frame, all by the first rule that finds any: mixing rules could pair a camera with a photo of
    the same name from another split."""
    folder = frames[0].file.parent
    longest = max(len(frame.parts) for frame in frames)
    for root, kept in _places(folder, longest):
        photos = [_existing(root.joinpath(*frame.parts[-kept:])) for frame in frames]
        if any(photos):
            return photos
    return [None] * len(frames)


def _places(folder: Path, longest: int) -> Iterator[tuple[Path, int]]:
    """Where photos may lie (root, number of last path parts; 0 = the whole path), likeliest first."""
    yield folder, 0
    for child in sorted(folder.iterdir()):
        if child.is_dir():
            yield child, 0
    for kept in range(min(longest - 1, MOST_PARTS), 0, -1):
        yield folder, kept


def _existing(path: Path) -> Path | None:
    candidates = (Path(f"{path}{suffix}") for suffix in ("", *PHOTO_SUFFIXES))
    return next((candidate for candidate in candidates if exists(candidate)), None)


# -------------------------------------------------------------------------------------------------------------- cameras
def _camera(frame: _Frame, image: Path | None) -> tuple[Camera, list[str]]:
    """The camera at the photo's size, and notes on what had to be changed."""
    fisheye = _is_fisheye(frame)
    declared = _declared_size(frame)
    size = photo_size(image, declared) if image else declared
    if size is None:
        raise DataError(f"{frame.label} declares no picture size.", "Write w and h into the file.")
    width, height = declared or size
    fx, fy = _focal_lengths(frame, width, height)
    camera_to_world, pose_notes = _pose(frame)
    camera = Camera(
        width=width,
        height=height,
        fx=fx,
        fy=fy,
        cx=_number(frame, "cx", width / 2),
        cy=_number(frame, "cy", height / 2),
        camera_to_world=camera_to_world,
        distortion=lens({key: _number(frame, key, 0.0) for key in LENS_KEYS}, fisheye),
        fisheye=fisheye,
    )
    camera, size_notes = at_size(camera, size)
    return check_camera(camera, frame.label, "Correct it in the file."), size_notes + pose_notes


def _is_fisheye(frame: _Frame) -> bool:
    model = frame.fields.get("camera_model") or ("OPENCV_FISHEYE" if frame.fields.get("is_fisheye") else "OPENCV")
    if model not in PERSPECTIVE + FISHEYE:
        raise DataError(f"{frame.label} has a {model!s:.200} camera, which cannot be read.", "Undistort the photos.")
    return model in FISHEYE or bool(frame.fields.get("is_fisheye"))


def _declared_size(frame: _Frame) -> tuple[int, int] | None:
    width, height = _positive(frame, "w"), _positive(frame, "h")
    if not (width and height):
        return None
    if max(width, height) > LARGEST_SIDE:
        raise DataError(f"{frame.label} declares {width:g}x{height:g} pixels.", "Correct w and h in the file.")
    return max(1, round(width)), max(1, round(height))


def _focal_lengths(frame: _Frame, width: int, height: int) -> tuple[float, float]:
    fx = _positive(frame, "fl_x") or _focal_from_angle(frame, "camera_angle_x", width)
    fy = _positive(frame, "fl_y") or _focal_from_angle(frame, "camera_angle_y", height)
    if fx is None and fy is None:
        raise DataError(f"{frame.label} has neither fl_x nor camera_angle_x.", "Write the focal length into the file.")
    return fx or fy, fy or fx


def _focal_from_angle(frame: _Frame, key: str, extent: int) -> float | None:
    """Focal length in pixels of a full field of view in radians: f = extent / 2 / tan(angle / 2)."""
    angle = _positive(frame, key)
    if angle is None:
        return None
    if angle >= math.pi:
        raise DataError(f"{frame.label} has {key} = {angle:g}, beyond pi.", "Field of view is given in radians.")
    return extent / 2 / math.tan(angle / 2)


def _pose(frame: _Frame) -> tuple[np.ndarray, list[str]]:
    """camera_to_world [4, 4] with a pure rotation, and a note on a uniform scale that was taken off it."""
    try:
        matrix = np.array(frame.fields.get("transform_matrix"), np.float64)
    except (TypeError, ValueError, OverflowError):
        matrix = np.empty(0)
    if matrix.shape == (3, 4):
        matrix = np.vstack([matrix, [0.0, 0.0, 0.0, 1.0]])
    if matrix.shape != (4, 4):
        raise DataError(f"{frame.label} has no 4x4 transform_matrix of numbers.", "Export the cameras again.")
    return rigid_pose(matrix, frame.label, "transform_matrix")


def _number(frame: _Frame, key: str, default: float | None = None) -> float | None:
    value = frame.fields.get(key)
    if value is None:
        return default
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e300:
        raise DataError(f"{frame.label} has {key} = {value!r:.200}, which is not a number.", "Correct it in the file.")
    return float(value)


def _positive(frame: _Frame, key: str) -> float | None:
    value = _number(frame, key)
    if value is not None and value <= 0:
        raise DataError(f"{frame.label} has {key} = {value:g}, which must be positive.", "Correct it in the file.")
    return value
