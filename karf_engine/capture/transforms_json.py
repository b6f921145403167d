"""Read and write `transforms*.json`: NeRF-synthetic captures, instant-ngp and nerfstudio files, and bare cameras.

Formats: the Blender script of NeRF (Mildenhall et al. 2020), instant-ngp's docs/nerf_dataset_tips.md and nerfstudio's data
conventions. All use OpenGL axes and pixel corners at integers, as `Camera`. k1..k6, p1, p2 are OpenCV's, of its fisheye
model if `camera_model` or `is_fisheye` says so. nerfstudio's `applied_transform` is already applied to poses and points,
so it is ignored, as are training settings. Our extension: `splat_file_path` names splats of another program in the world
of the poses, and `splat_antialiased` is `CapturedSplats.is_antialiased`.

A `file_path` is relative to the JSON's folder. In practice it may lack its suffix, be an absolute path of another machine,
or lack the folder that the photos were moved to.
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
from .reader_utils import FISHEYE_KEYS, LENS_KEYS, PHOTO_SUFFIXES, exists, make_views, merge_notes
from .sparse_point_files import read_points
from .transforms_frames import Frame, camera_of, read_frames

SYNTHETIC_FILES = {f"transforms_{split}.json": split for split in SPLITS}
MOST_PARTS = 32  # trailing path components to try in searches for photos


# -------------------------------------------------------------------------------------------------------------- readers
def is_nerf_synthetic(path: Path) -> bool:
    """Test whether `path` is a folder with transforms_train.json, or a split file beside it."""
    folder = path if path.is_dir() else path.parent if path.name in SYNTHETIC_FILES else None
    return folder is not None and (folder / "transforms_train.json").is_file()


def is_transforms(path: Path) -> bool:
    """Test whether `path` is a folder with transforms.json, or any JSON file."""
    return (path / "transforms.json").is_file() or (path.is_file() and path.suffix.lower() == ".json")


def read_nerf_synthetic(path: Path, photos: bool) -> Capture:
    """Read all splits of a NeRF-synthetic folder; only the given file if `path` is one and `photos` is False.

    Raises DataError if a file is missing or damaged.
    """
    if path.is_file() and not photos:
        return read_transforms(path, photos)
    folder = path if path.is_dir() else path.parent
    files = [(folder / name, split) for name, split in SYNTHETIC_FILES.items() if (folder / name).is_file()]
    return _read(path, "nerf-synthetic", files, photos)


def read_transforms(path: Path, photos: bool) -> Capture:
    """Read a transforms file, or the transforms.json of a folder.

    With `photos`, frames without one are skipped with a remark, and sizes are those of the photos; else the file must
    declare sizes. Raises DataError if the file is damaged, or no photo is found.
    """
    file = path if path.is_file() else path / "transforms.json"
    return _read(path, "transforms", [(file, SYNTHETIC_FILES.get(file.name, ""))], photos)


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
    """Convert a camera to a frame, which `transforms_frames.camera_from_json` reads without loss."""
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
    views, remarks = _views(pairs)
    if missing:
        first = missing[0].fields["file_path"][:200]
        remarks.insert(0, f"{len(missing)} of {len(frames)} photos are missing and were skipped; the first is {first}.")
    remarks += point_remarks
    return Capture(source.absolute(), format_name, tuple(views), tuple(remarks), points, splats=splats)


def _points(frame: Frame) -> tuple[SparsePoints | None, list[str]]:
    """Read the points of nerfstudio's `ply_file_path`, or return a remark if the file is missing."""
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
    """Return the file that a global field names, relative to the JSON's folder; None if there is no such field."""
    name = frame.fields.get(key)
    if not isinstance(name, str) or not name:
        return None
    return frame.file.parent.joinpath(*PurePosixPath(name.replace("\\", "/")).parts)


def _views(pairs: Sequence[tuple[Frame, Path | None]]) -> tuple[list[View], list[str]]:
    """Return the views in frame order, and merged notes about their cameras."""
    cameras = [camera_of(frame, image) for frame, image in pairs]
    images = [image for _, image in pairs]
    stems = [_stem(frame, image) for frame, image in pairs]
    splits = [frame.split or "train" for frame, _ in pairs]
    views = make_views([camera for camera, _ in cameras], images, stems, splits)
    return views, merge_notes(note for _, notes in cameras for note in notes)


# --------------------------------------------------------------------------------------------------------------- photos
def _stem(frame: Frame, image: Path | None) -> str:
    if image:
        return image.stem
    name = PurePosixPath(frame.parts[-1])
    return name.stem if name.suffix.lower() in PHOTO_SUFFIXES else name.name


def _find_photos(frames: list[Frame]) -> list[Path | None]:
    """Return the photo of each frame, all from the first search location with any.

    Mixing locations could pair a camera with a photo of the same name from another split.
    """
    folder = frames[0].file.parent
    longest = max(len(frame.parts) for frame in frames)
    for root, n_parts in _search_locations(folder, longest):
        photos = [_existing(root.joinpath(*frame.parts[-n_parts:])) for frame in frames]
        if any(photos):
            return photos
    return [None] * len(frames)


def _search_locations(folder: Path, longest: int) -> Iterator[tuple[Path, int]]:
    """Yield (root, number of trailing path components; 0 for the whole path), likeliest first."""
    yield folder, 0
    for child in sorted(folder.iterdir()):
        if child.is_dir():
            yield child, 0
    for n_parts in range(min(longest - 1, MOST_PARTS), 0, -1):
        yield folder, n_parts


def _existing(path: Path) -> Path | None:
    candidates = (Path(f"{path}{suffix}") for suffix in ("", *PHOTO_SUFFIXES))
    return next((candidate for candidate in candidates if exists(candidate)), None)
