"""Read and write `transforms*.json`: NeRF-synthetic captures, instant-ngp and nerfstudio files, and bare cameras.

Formats: the Blender script of NeRF (Mildenhall et al. 2020), instant-ngp's docs/nerf_dataset_tips.md and nerfstudio's data
conventions. All use OpenGL axes and pixel corners at integers, as `Camera`. k1..k6, p1, p2 are OpenCV's, of its fisheye
model if `camera_model` or `is_fisheye` says so; fisheye lenses with a thin prism (see `distortion`) have COLMAP's names of
their models, and k1..k6, p1, p2, s1..s4. nerfstudio's `applied_transform` is already applied to poses and points,
so it is ignored, as are training settings. Our extension: `splat_file_path` names splats of another program in the world
of the poses, and `splat_antialiased` is `CapturedSplats.is_antialiased`.

A `file_path` is relative to the JSON's folder. In practice it may lack its suffix, be an absolute path of another machine,
or lack the folder that the photos were moved to.
"""

from __future__ import annotations

import math
import os
from collections import ChainMap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from ..errors import DataError
from ..io.files import read_json, write_json
from ..io.matching import FileFinder, find_entry, is_photo
from .camera import LARGEST_SIDE, Camera, Panorama, check_camera, read_camera
from .capture import SPLITS, Capture, CapturedSplats, SparsePoints, View
from .distortion import FISHEYE_KEYS, RAD_TAN_KEYS, THIN_PRISM_KEYS
from .reader_utils import (
    LENS_KEYS,
    at_size,
    exists,
    make_views,
    merge_notes,
    opencv_distortion,
    photo_size,
    read_each,
    rigid_pose,
)
from .sparse_points import read_points

SYNTHETIC_FILES = {f"transforms_{split}.json": split for split in SPLITS}
PERSPECTIVE = ("PERSPECTIVE", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV")
FISHEYE = {  # camera model: names of its coefficients
    "OPENCV_FISHEYE": FISHEYE_KEYS,
    "SIMPLE_RADIAL_FISHEYE": FISHEYE_KEYS,
    "RADIAL_FISHEYE": FISHEYE_KEYS,
    "THIN_PRISM_FISHEYE": THIN_PRISM_KEYS,
    "RAD_TAN_THIN_PRISM_FISHEYE": RAD_TAN_KEYS,
}
PANORAMA = "EQUIRECTANGULAR"
MOST_PARTS = 32  # trailing path components to try in searches for photos


# -------------------------------------------------------------------------------------------------------------- readers
def is_nerf_synthetic(path: Path) -> bool:
    """Test whether `path` is a folder with transforms_train.json, or a split file beside it."""
    folder = path if path.is_dir() else path.parent if path.name in SYNTHETIC_FILES else None
    return folder is not None and find_entry(folder, "transforms_train.json").is_file()


def is_transforms(path: Path) -> bool:
    """Test whether `path` is a folder with transforms.json, or any JSON file."""
    return find_entry(path, "transforms.json").is_file() or (path.is_file() and path.suffix.lower() == ".json")


def read_nerf_synthetic(path: Path, photos: bool) -> Capture:
    """Read all splits of a NeRF-synthetic folder; only the given file if `path` is one and `photos` is False.

    Raises DataError if a file is missing or damaged.
    """
    if path.is_file() and not photos:
        return read_transforms(path, photos)
    folder = path if path.is_dir() else path.parent
    files = [(find_entry(folder, name), split) for name, split in SYNTHETIC_FILES.items()]
    return _read(path, "nerf-synthetic", [entry for entry in files if entry[0].is_file()], photos)


def read_transforms(path: Path, photos: bool) -> Capture:
    """Read a transforms file, or the transforms.json of a folder.

    With `photos`, frames without one are skipped with a remark, and sizes are those of the photos; else the file must
    declare sizes. Raises DataError if the file is damaged, or no photo is found.
    """
    file = path if path.is_file() else find_entry(path, "transforms.json")
    return _read(path, "transforms", [(file, SYNTHETIC_FILES.get(file.name, ""))], photos)


def _read(source: Path, format_name: str, files: list[tuple[Path, str]], photos: bool) -> Capture:
    remarks: list[str] = []
    per_file = []
    for file, split in files:
        group, frame_remarks = _read_frames(file, split, skip=photos)
        per_file.append(group)
        remarks += frame_remarks
    frames = [frame for group in per_file for frame in group]
    if not photos:
        return Capture(source.absolute(), format_name, tuple(_views([(frame, None) for frame in frames], False)[0]))
    points, point_remarks = _points(frames[0])
    splats = _splats(frames[0])
    images = [image for group in per_file for image in _find_photos(group)]
    pairs = [(frame, image) for frame, image in zip(frames, images, strict=True) if image]
    missing = [frame for frame, image in zip(frames, images, strict=True) if not image]
    if not pairs:
        first = ", ".join(f"{frame.fields['file_path']:.200}" for frame in missing[:3])
        raise DataError(
            "{path}: none of its {count} photos was found, the first are {first}.",
            "Put the photos below {folder}, or write each file_path relative to that folder.",
            path=source,
            count=len(missing),
            first=first,
            folder=frames[0].file.parent,
        )
    if missing:
        first = missing[0].fields["file_path"][:200]
        remarks.append(f"{len(missing)} of {len(frames)} photos are missing and were skipped; the first is {first}.")
    views, view_remarks = _views(pairs, True)
    remarks += view_remarks + point_remarks
    return Capture(source.absolute(), format_name, tuple(views), tuple(remarks), points, splats=splats)


def _points(frame: _Frame) -> tuple[SparsePoints | None, list[str]]:
    """Read the points of nerfstudio's `ply_file_path`, or return a remark if the file is missing."""
    path = _file_beside(frame, "ply_file_path")
    if path is None:
        return None, []
    if not exists(path):
        name = frame.fields["ply_file_path"]
        return None, [f"Its sparse points {name} are missing; there are none without them."]
    points = read_points(path)
    return points if len(points) else None, []


def _splats(frame: _Frame) -> CapturedSplats | None:
    path = _file_beside(frame, "splat_file_path")
    if path is None:
        return None
    if not exists(path):
        raise DataError(f"{frame.file} names the splats {path}, which are missing.", "Import the splats again.")
    return CapturedSplats(path.absolute(), bool(frame.fields.get("splat_antialiased")))


def _file_beside(frame: _Frame, key: str) -> Path | None:
    """Return the file that a global field names, relative to the JSON's folder; None if there is no such field."""
    name = frame.fields.get(key)
    if not isinstance(name, str) or not name:
        return None
    return frame.file.parent.joinpath(*PurePosixPath(name.replace("\\", "/")).parts)


def _views(pairs: Sequence[tuple[_Frame, Path | None]], skip: bool) -> tuple[list[View], list[str]]:
    """Return the views in frame order, without damaged ones if `skip`, and merged notes about their cameras."""

    def read(pair: tuple[_Frame, Path | None]) -> tuple[_Frame, Path | None, Camera, list[str]]:
        return *pair, *_camera(*pair)

    entries, remarks = read_each(pairs, read, skip)
    stems = [image.stem if image else _bare_stem(frame) for frame, image, _, _ in entries]
    splits = [frame.split or "train" for frame, *_ in entries]
    views = make_views([entry[2] for entry in entries], [entry[1] for entry in entries], stems, splits)
    masks = [frame.mask for frame, *_ in entries]
    views = [replace(view, mask=mask) if mask else view for view, mask in zip(views, masks, strict=True)]
    return views, remarks + merge_notes(note for *_, notes in entries for note in notes)


# --------------------------------------------------------------------------------------------------------------- frames
@dataclass(frozen=True)
class _Frame:
    """One entry of `frames`."""

    file: Path
    index: int
    parts: tuple[str, ...]  # path components of its `file_path`
    fields: Mapping[str, Any]  # override the file's global fields
    split: str  # empty if the file declares none

    @property
    def mask(self) -> str:
        """The file name of nerfstudio's `mask_path`, or an empty string."""
        path = self.fields.get("mask_path")
        return PurePosixPath(path.replace("\\", "/")).name if isinstance(path, str) else ""

    @property
    def label(self) -> str:
        return f"{self.file}, frame {self.index} ({self.fields['file_path']!r:.200})"

    def number(self, key: str) -> float | None:
        value = self.fields.get(key)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e300:
            raise DataError(
                f"{self.label} has {key} = {value!r:.200}, which is not a number.", "Correct it in the file."
            )
        return float(value)

    def number_or(self, key: str, default: float) -> float:
        value = self.number(key)
        return default if value is None else value

    def positive(self, key: str) -> float | None:
        value = self.number(key)
        if value is not None and value <= 0:
            raise DataError(f"{self.label} has {key} = {value:g}, which must be positive.", "Correct it in the file.")
        return value


def _read_frames(file: Path, split: str, skip: bool) -> tuple[list[_Frame], list[str]]:
    """Read all frames of a transforms file; an empty `split` means those that the file declares. See `read_each`."""
    content = read_json(file, "cameras")
    if not isinstance(content, dict):
        raise DataError(f"{file} holds a JSON {type(content).__name__}, not an object.", "Give a transforms.json file.")
    entries = content.get("frames")
    if not isinstance(entries, list) or not entries:
        raise DataError(f"{file} has no list of frames.", "Give a transforms.json file with at least one frame.")
    shared = {key: value for key, value in content.items() if key != "frames"}
    lists = {name: shared.get(f"{name}_filenames") for name in SPLITS}  # nerfstudio's
    declared = {str(path): name for name, paths in lists.items() if isinstance(paths, list) for path in paths}

    def read(numbered: tuple[int, Any]) -> _Frame:
        index, entry = numbered
        file_path = entry.get("file_path") if isinstance(entry, dict) else None
        path = PurePosixPath(file_path.replace("\\", "/")) if isinstance(file_path, str) else PurePosixPath()
        if not isinstance(file_path, str) or not path.name:
            raise DataError(f"{file}, frame {index} has no file_path.", "Write the photo's path into the frame.")
        return _Frame(file, index, path.parts, ChainMap(entry, shared), split or declared.get(file_path, ""))

    return read_each(list(enumerate(entries)), read, skip)


def _camera(frame: _Frame, image: Path | None) -> tuple[Camera, list[str]]:
    """Return the camera of a frame at its photo's size (without one, the declared size), and notes on changes."""
    model = _camera_model(frame)
    declared = _declared_size(frame)
    size = photo_size(image, declared) if image else declared
    if size is None:
        raise DataError(f"{frame.label} declares no picture size.", "Write w and h into the file.")
    width, height = declared or size
    camera_to_world, pose_notes = _pose(frame)
    if model == PANORAMA:
        return Panorama.of(frame.label, *size, camera_to_world), pose_notes
    fx, fy = _focal_lengths(frame, width, height)
    cx, cy = frame.number_or("cx", width / 2), frame.number_or("cy", height / 2)
    fisheye, keys = model in FISHEYE, FISHEYE.get(model, LENS_KEYS)
    lens = opencv_distortion({key: frame.number_or(key, 0.0) for key in keys}, fisheye, keys)
    hint = "Correct it in the file."
    camera = read_camera(frame.label, width, height, fx, fy, cx, cy, camera_to_world, lens, fisheye, hint=hint)
    camera, size_notes = at_size(camera, size)
    return check_camera(camera, frame.label, hint), size_notes + pose_notes


def camera_from_json(fields: Any, source: str) -> Camera:
    """Read a bare camera from a frame with a size; `source` names it in messages. Raises DataError if it is damaged."""
    if not isinstance(fields, dict):
        raise DataError(f"{source} has a JSON {type(fields).__name__} for a camera.", "Give an object.")
    camera = _camera(_Frame(Path(source), 0, (), {"file_path": "camera", **fields}, ""), None)[0]
    if isinstance(camera, Panorama):
        raise DataError(f"{source} has a {PANORAMA} camera.", "Give a perspective or fisheye one.")
    return camera


def _camera_model(frame: _Frame) -> str:
    model = frame.fields.get("camera_model") or "OPENCV"
    if model not in (*PERSPECTIVE, *FISHEYE, PANORAMA):
        raise DataError(f"{frame.label} has a {model!s:.200} camera, which cannot be read.", "Undistort the photos.")
    return "OPENCV_FISHEYE" if frame.fields.get("is_fisheye") and model in PERSPECTIVE else model


def _declared_size(frame: _Frame) -> tuple[int, int] | None:
    width, height = frame.positive("w"), frame.positive("h")
    if not (width and height):
        return None
    if max(width, height) > LARGEST_SIDE:
        raise DataError(f"{frame.label} declares {width:g}x{height:g} pixels.", "Correct w and h in the file.")
    return max(1, round(width)), max(1, round(height))


def _focal_lengths(frame: _Frame, width: int, height: int) -> tuple[float, float]:
    fx = frame.positive("fl_x") or _focal_from_angle(frame, "camera_angle_x", width)
    fy = frame.positive("fl_y") or _focal_from_angle(frame, "camera_angle_y", height)
    if fx is None:
        fx = fy
    if fx is None:
        raise DataError(f"{frame.label} has neither fl_x nor camera_angle_x.", "Write the focal length into the file.")
    return fx, fx if fy is None else fy


def _focal_from_angle(frame: _Frame, key: str, extent: int) -> float | None:
    """Convert a full field of view in radians to a focal length in pixels."""
    angle = frame.positive(key)
    if angle is None:
        return None
    if angle >= math.pi:
        raise DataError(f"{frame.label} has {key} = {angle:g}, beyond pi.", "Field of view is given in radians.")
    return extent / 2 / math.tan(angle / 2)


def _pose(frame: _Frame) -> tuple[np.ndarray, list[str]]:
    try:
        matrix = np.array(frame.fields.get("transform_matrix"), np.float64)
    except (TypeError, ValueError, OverflowError):
        matrix = np.empty(0)
    if matrix.shape == (3, 4):
        matrix = np.vstack([matrix, [0.0, 0.0, 0.0, 1.0]])
    if matrix.shape != (4, 4):
        raise DataError(f"{frame.label} has no 4x4 transform_matrix of numbers.", "Export the cameras again.")
    return rigid_pose(matrix, frame.label, "transform_matrix")


# --------------------------------------------------------------------------------------------------------------- photos
def _bare_stem(frame: _Frame) -> str:
    name = PurePosixPath(frame.parts[-1])
    return name.stem if is_photo(name) else name.name


def _find_photos(frames: list[_Frame]) -> list[Path | None]:
    """Return the photo of each frame, all from the first location with any: others may have those of another split."""
    folder = frames[0].file.parent
    longest = max(len(frame.parts) for frame in frames)
    for rule in (FileFinder.exact, FileFinder.matches):
        for root, n_parts in _search_locations(folder, longest):
            finder, paths = FileFinder(root), [PurePosixPath(*frame.parts[-n_parts:]) for frame in frames]
            if any(rule(finder, path) for path in paths):
                return [finder.find(path) for path in paths]
    return [None] * len(frames)


def _search_locations(folder: Path, longest: int) -> Iterator[tuple[Path, int]]:
    """Yield (root, number of trailing path components; 0 for the whole path), likeliest first."""
    yield folder, 0
    for child in sorted(folder.iterdir()):
        if child.is_dir():
            yield child, 0
    for n_parts in range(min(longest - 1, MOST_PARTS), 0, -1):
        yield folder, n_parts


# -------------------------------------------------------------------------------------------------------------- writers
def write_capture(path: Path, capture: Capture, folder: Path) -> None:
    """Write the views, photos and splats of a capture as an instant-ngp style file, without its sparse points.

    The file, and all files beside it, will be moved to `folder`.
    """

    def relative(file: Path) -> str:
        if file.is_relative_to(path.parent):
            return file.relative_to(path.parent).as_posix()
        try:
            return Path(os.path.relpath(file, folder)).as_posix()
        except ValueError:  # another drive
            return file.as_posix()

    splats = {}
    if capture.splats is not None:
        splats = {"splat_file_path": relative(capture.splats.path), "splat_antialiased": capture.splats.is_antialiased}
    named = []
    for view in capture.views:
        assert view.image is not None, "write_capture needs photos"
        named.append((relative(view.image), view))
    write_json(path, {"camera_model": "OPENCV", **splats, **_frames_to_json(named)})


def write_cameras(path: Path, views: Sequence[View]) -> None:
    """Write bare cameras as an instant-ngp style file, which `open_capture(path, photos=False)` reads without loss."""
    write_json(path, {"camera_model": "OPENCV", **_frames_to_json([(view.name, view) for view in views])})


def _frames_to_json(named: list[tuple[str, View]]) -> dict[str, Any]:
    frames = [{"file_path": name, **camera_to_json(view.camera)} for name, view in named]
    splits = {f"{split}_filenames": [name for name, view in named if view.split == split] for split in SPLITS}
    return {"frames": frames, **splits}


def camera_to_json(camera: Camera) -> dict[str, Any]:
    """Convert a camera to a frame, which `camera_from_json` reads without loss."""
    models = {len(keys): model for model, keys in reversed(FISHEYE.items())}
    model = models.get(len(camera.distortion), "OPENCV_FISHEYE") if camera.fisheye else "OPENCV"
    keys = FISHEYE.get(model, LENS_KEYS)
    return {
        **({"camera_model": model} if camera.fisheye else {}),
        "w": camera.width,
        "h": camera.height,
        "fl_x": float(camera.fx),
        "fl_y": float(camera.fy),
        "cx": float(camera.cx),
        "cy": float(camera.cy),
        **dict(zip(keys, map(float, camera.distortion), strict=False)),
        "transform_matrix": camera.camera_to_world.tolist(),
    }
