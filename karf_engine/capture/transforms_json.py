"""Cameras in `transforms*.json`: NeRF-synthetic captures, instant-ngp and nerfstudio files, and camera files of ours.

Formats: the Blender script of NeRF (Mildenhall et al. 2020), instant-ngp's docs/nerf_dataset_tips.md and nerfstudio's
data conventions. All use OpenGL axes and pixel corners at integers, as `Camera` does; k1..k6 p1 p2 are OpenCV's, and of
its fisheye model where `camera_model` or `is_fisheye` asks for it. nerfstudio's `applied_transform` has been applied to
the poses and to the points of `ply_file_path` alike, so it changes nothing here; nor do fields that steer training.
What is ours alone is `splat_file_path`: Gaussians that another program has learned of the scene, in the world of the
poses; `splat_antialiased` says how they were learned.
A `file_path` is relative to the JSON's folder; in the wild it also lacks its extension, is an absolute path of another
machine, or leaves out the folder that the photos were moved to.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

from ..errors import DataError
from ..io.files import write_json
from .camera import Camera
from .capture import SPLITS, Capture, CapturedSplats, SparsePoints, View
from .ply import read_points
from .reading import FISHEYE_KEYS, LENS_KEYS, PHOTO_SUFFIXES, exists, make_views, merge_notes
from .transforms_frames import Frame, camera_of, read_frames

SYNTHETIC_FILES = {f"transforms_{split}.json": split for split in SPLITS}
MOST_PARTS = 32  # trailing parts of a photo's path that are searched for elsewhere


# -------------------------------------------------------------------------------------------------------------- readers
def is_nerf_synthetic(path: Path) -> bool:
    """Whether `path` is a folder with transforms_train.json, or one of the split files beside it."""
    folder = path if path.is_dir() else path.parent if path.name in SYNTHETIC_FILES else None
    return folder is not None and (folder / "transforms_train.json").is_file()


def is_transforms(path: Path) -> bool:
    """Whether `path` is a folder with transforms.json, or any JSON file."""
    return (path / "transforms.json").is_file() or (path.is_file() and path.suffix.lower() == ".json")


def read_nerf_synthetic(path: Path, photos: bool) -> Capture:
    """Read the splits of a NeRF-synthetic folder; without photos, one split's file is read alone.

    Without transforms_test.json there are no test views.

    Args:
        path: The folder, or one of its split files.
        photos: Whether to look for the photos.

    Raises:
        DataError: A file is missing or damaged; names the file and the frame.
    """
    if path.is_file() and not photos:
        return read_transforms(path, photos)
    folder = path if path.is_dir() else path.parent
    files = [(folder / name, split) for name, split in SYNTHETIC_FILES.items() if (folder / name).is_file()]
    return _read(path, "nerf-synthetic", files, photos)


def read_transforms(path: Path, photos: bool) -> Capture:
    """Read one transforms file, or the transforms.json of a folder.

    Args:
        path: The file, or its folder.
        photos: With photos, frames without one are skipped with a remark, and sizes are those of the photos.
            Without, sizes must be in the file.

    Raises:
        DataError: The file is damaged, or none of its photos is found; names the file and the frame.
    """
    file = path if path.is_file() else path / "transforms.json"
    return _read(path, "transforms", [(file, SYNTHETIC_FILES.get(file.name, ""))], photos)


def write_capture(path: Path, capture: Capture, folder: Path) -> None:
    """Write a capture's views, photos and splats as an instant-ngp style file, without its sparse points.

    Args:
        path: The file.
        capture: With photos.
        folder: Where the file will lie; what lies beside the file now will lie beside it there.
    """

    def from_there(file: Path) -> str:
        if file.is_relative_to(path.parent):
            return file.relative_to(path.parent).as_posix()
        try:
            return Path(os.path.relpath(file, folder)).as_posix()
        except ValueError:  # another drive
            return file.as_posix()

    splats = {}
    if capture.splats is not None:
        splats = {
            "splat_file_path": from_there(capture.splats.path),
            "splat_antialiased": capture.splats.is_antialiased,
        }
    names = [from_there(view.image) for view in capture.views]
    frames = [
        {"file_path": name, **camera_to_json(view.camera)} for name, view in zip(names, capture.views, strict=True)
    ]
    splits = {
        split: [name for name, view in zip(names, capture.views, strict=True) if view.split == split]
        for split in SPLITS
    }
    declared = {f"{split}_filenames": those for split, those in splits.items()}
    write_json(path, {"camera_model": "OPENCV", **splats, "frames": frames, **declared})


def write_cameras(path: Path, views: Sequence[View]) -> None:
    """Write bare cameras as an instant-ngp style file; `open_capture(path, photos=False)` gives them back exactly."""
    content = {
        "camera_model": "OPENCV",
        "frames": [{"file_path": view.name, **camera_to_json(view.camera)} for view in views],
        **{f"{split}_filenames": [view.name for view in views if view.split == split] for split in SPLITS},
    }
    write_json(path, content)


def camera_to_json(camera: Camera) -> dict[str, Any]:
    """A camera as a frame of such a file has it; `transforms_frames.camera_from_json` gives it back exactly."""
    keys = FISHEYE_KEYS if camera.fisheye else LENS_KEYS
    return {
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
    per_file = [read_frames(file, split) for file, split in files]
    frames = [frame for group in per_file for frame in group]
    if not photos:
        return Capture(source.absolute(), format_name, tuple(_views([(frame, None) for frame in frames])[0]))
    points, remarks_of_points = _points(frames[0])
    splats = _splats(frames[0])
    images = [image for group in per_file for image in _find_photos(group)]
    found = [(frame, image) for frame, image in zip(frames, images, strict=True) if image]
    missing = [frame for frame, image in zip(frames, images, strict=True) if not image]
    if not found:
        first = ", ".join(f"{frame.fields['file_path']:.200}" for frame in missing[:3])
        raise DataError(
            "{path}: none of its {count} photos was found, the first are {first}.",
            "Put the photos below {folder}, or write each file_path relative to that folder.",
            path=source,
            count=len(missing),
            first=first,
            folder=frames[0].file.parent,
        )
    views, remarks = _views(found)
    if missing:
        first = missing[0].fields["file_path"][:200]
        remarks.insert(0, f"{len(missing)} of {len(frames)} photos are missing and were skipped; the first is {first}.")
    remarks += remarks_of_points
    return Capture(source.absolute(), format_name, tuple(views), tuple(remarks), points, splats=splats)


def _points(frame: Frame) -> tuple[SparsePoints | None, list[str]]:
    """The points of nerfstudio's `ply_file_path`, and a remark where the file is missing."""
    path = _file_beside(frame, "ply_file_path")
    if path is None:
        return None, []
    if not exists(path):
        name = frame.fields["ply_file_path"]
        return None, [f"Its sparse points {name} are missing; there are none without them."]
    points = read_points(path)
    return points if len(points) else None, []


def _splats(frame: Frame) -> CapturedSplats | None:
    path = _file_beside(frame, "splat_file_path")
    if path is None:
        return None
    if not exists(path):
        raise DataError(f"{frame.file} names the splats {path}, which are missing.", "Import the splats again.")
    return CapturedSplats(path.absolute(), bool(frame.fields.get("splat_antialiased")))


def _file_beside(frame: Frame, key: str) -> Path | None:
    """The file that a global field names, from the JSON's folder; None where there is no such field."""
    name = frame.fields.get(key)
    if not isinstance(name, str) or not name:
        return None
    return frame.file.parent.joinpath(*PurePosixPath(name.replace("\\", "/")).parts)


def _views(found: list[tuple[Frame, Path | None]]) -> tuple[list[View], list[str]]:
    """Views in frame order, and what was noted about their cameras with the number of views it holds for."""
    cameras = [camera_of(frame, image) for frame, image in found]
    images = [image for _, image in found]
    stems = [_stem(frame, image) for frame, image in found]
    splits = [frame.split or "train" for frame, _ in found]
    views = make_views([camera for camera, _ in cameras], images, stems, splits)
    return views, merge_notes(note for _, notes in cameras for note in notes)


# --------------------------------------------------------------------------------------------------------------- photos
def _stem(frame: Frame, image: Path | None) -> str:
    if image:
        return image.stem
    name = PurePosixPath(frame.parts[-1])
    return name.stem if name.suffix.lower() in PHOTO_SUFFIXES else name.name


def _find_photos(frames: list[Frame]) -> list[Path | None]:
    """The photo of each frame, all by the first rule that finds any.

    Mixing rules could pair a camera with a photo of the same name from another split.
    """
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
