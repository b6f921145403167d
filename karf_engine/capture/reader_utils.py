"""Shared code of the capture readers: whole files, poses, lens parameters, photos and views."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np

from ..errors import DataError
from ..io.files import check_file, refusing_unreadable
from ..io.image_size import LFS_POINTER, image_header
from ..io.matching import is_photo
from ..io.names import case_folded, file_name
from .camera import LARGEST_POSITION, Camera, is_rigid
from .capture import View
from .distortion import FISHEYE_KEYS

LENS_KEYS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
UNIT_TOLERANCE = 1e-5  # deviation of a scale from 1 that single precision explains
T = TypeVar("T")
R = TypeVar("R")


# ---------------------------------------------------------------------------------------------------------------- files
def read_bytes(path: Path) -> bytes:
    """Read a file. Raises DataError if it cannot be read, is empty, or is a Git-LFS pointer."""
    check_file(path)
    with refusing_unreadable(path):
        data = path.read_bytes()
    if not data:
        raise DataError("{path} is empty.", "Copy the file again.", path=path)
    if data.startswith(LFS_POINTER):
        raise DataError(f"{path} is a Git-LFS pointer, not the file.", "Fetch the files with: git lfs pull.")
    return data


def read_text(path: Path) -> str:
    """Read a UTF-8 text file. Raises DataError as `read_bytes`, or if it is not UTF-8."""
    try:
        return read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DataError(f"{path} is not UTF-8 text: {error.reason}.", "Export or copy the file again.") from error


# ---------------------------------------------------------------------------------------------------------------- poses
def rigid_pose(matrix: np.ndarray, label: str, what: str) -> tuple[np.ndarray, list[str]]:
    """Remove a uniform scale from the rotation of a camera_to_world [4, 4]; also return a note if there was one.

    Raises DataError "`label` has a `what` that ..." if the matrix is not finite, too large, or otherwise not a pose.
    """
    if not np.abs(matrix).max() <= LARGEST_POSITION:
        raise DataError(f"{label} has a {what} that is not finite.", "Leave this photo out.")
    scale = float(np.linalg.norm(matrix[:3, :3], axis=0).mean())
    unscaled = matrix.copy()
    unscaled[:3, :3] /= max(scale, 1e-12)
    if not is_rigid(unscaled):
        raise DataError(
            f"{label} has a {what} that is not a rotation with a uniform scale.",
            "Export the cameras without shear, mirroring or unequal scales.",
        )
    if abs(scale - 1.0) <= UNIT_TOLERANCE:
        return matrix, []
    return unscaled, [f"the rotation had a scale of {scale:.6g}, which was removed."]


def pose_of_opencv(rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """Convert a pose from world to a camera with axes right, down and forward to camera_to_world [4, 4]."""
    camera_to_world = np.eye(4)
    camera_to_world[:3, :3] = rotation.T * (1, -1, -1)
    camera_to_world[:3, 3] = -rotation.T @ translation
    return camera_to_world


def rotation_of_quaternion(w: float, x: float, y: float, z: float) -> np.ndarray:
    """Return the rotation matrix [3, 3] of a quaternion of any length but 0."""
    w, x, y, z = (np.array([w, x, y, z]) / np.linalg.norm([w, x, y, z])).tolist()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def rotation_of_vector(vector: np.ndarray) -> np.ndarray:
    """Return the rotation matrix [3, 3] of a vector along its axis, as long as its angle in radians."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / max(angle, 1e-12) * np.sin(angle / 2)
    return rotation_of_quaternion(float(np.cos(angle / 2)), x, y, z)


def opencv_distortion(
    coefficients: Mapping[str, float], fisheye: bool, fisheye_keys: tuple[str, ...] = FISHEYE_KEYS
) -> tuple[float, ...]:
    """Convert coefficients by OpenCV's names, 0 if absent, to the shortest equivalent `Camera.distortion`.

    `fisheye_keys` are those of one of the fisheye models in the module `distortion`.
    """
    values = [float(coefficients.get(key, 0.0)) for key in (fisheye_keys if fisheye else LENS_KEYS)]
    lengths = (0, 4, len(fisheye_keys)) if fisheye else (0, 4, 5, 8)
    return tuple(values[: next(length for length in lengths if not any(values[length:]))])


# --------------------------------------------------------------------------------------------------------------- photos
def photos_in(folder: Path) -> list[Path]:
    """Return the photos directly in a folder, sorted; none if the folder is missing."""
    if not folder.is_dir():
        return []
    files = (path for path in folder.iterdir() if is_photo(path) and path.name[0] != ".")
    return sorted(path for path in files if path.is_file())


def exists(path: Path) -> bool:
    """Test whether a path is a file; False for invalid names."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def photo_size(image: Path, declared: tuple[int, int] | None) -> tuple[int, int]:
    """Return width and height of a photo in the orientation of its camera. Raises DataError if it is damaged.

    Cameras are of the photo as displayed, unless the `declared` size has the aspect of the photo as stored.
    """
    header = image_header(image)
    if declared and header.swaps_sides and (declared[0] > declared[1]) == (header.width > header.height):
        return header.stored_size
    return header.display_size


def at_size(camera: Camera, size: tuple[int, int]) -> tuple[Camera, list[str]]:
    """Scale a camera to its photo's size (width, height); also return a note if that changed it."""
    if size == (camera.width, camera.height):
        return camera, []
    note = f"photos are {size[0]}x{size[1]} where the file says {camera.width}x{camera.height}; "
    return camera.scaled(*size), [note + "their intrinsics were scaled."]


def at_photo(camera: Camera, image: Path | None) -> tuple[Camera, list[str]]:
    """Scale a camera to its photo's size, as `at_size`; without a photo it stays."""
    return at_size(camera, photo_size(image, (camera.width, camera.height))) if image else (camera, [])


# ---------------------------------------------------------------------------------------------------------------- views
def make_views(
    cameras: Iterable[Camera], images: Iterable[Path | None], stems: Iterable[str], splits: Iterable[str]
) -> list[View]:
    """Make views with unique, valid file names, derived from the stems; bare cameras have None for an image."""
    stems, splits = list(map(file_name, stems)), list(splits)
    names = unique_names(list(zip(splits, stems, strict=True)))
    return [
        View(name, stem, camera, image.absolute() if image else None, split)
        for name, stem, camera, image, split in zip(names, stems, cameras, images, splits, strict=True)
    ]


def unique_names(stems: list[tuple[str, str]]) -> list[str]:
    """Return a unique name for each (split, stem): the stem if it is unique, else split_stem, else numbered.

    NeRF-synthetic captures repeat stems in each split. Names that differ in case or Unicode form only are not unique.
    """
    count = Counter(case_folded(stem) for _, stem in stems)
    names, taken, numbers = [], set(), {}
    for split, stem in stems:
        name = base = stem if count[case_folded(stem)] == 1 else f"{split}_{stem}"
        while case_folded(name) in taken:
            numbers[base] = numbers.get(base, 1) + 1
            name = f"{base}_{numbers[base]}"
        taken.add(case_folded(name))
        names.append(name)
    return names


def read_each(items: Sequence[T], read: Callable[[T], R], skip: bool) -> tuple[list[R], list[str]]:
    """Read every photo's entry; with `skip`, leave out those with an error, and return a remark that counts them.

    Raises the first DataError without `skip`, or if no entry can be read: the fault is in all of them.
    """
    results: list[R] = []
    errors: list[DataError] = []
    for item in items:
        try:
            results.append(read(item))
        except DataError as error:
            errors.append(error)
            if not skip:
                break
    if errors and not (skip and results):
        raise errors[0]
    return results, [f"{len(errors)} of {len(items)} photos were left out: {errors[0].sentence}"] if errors else []


def merge_notes(notes: Iterable[str]) -> list[str]:
    """Merge equal notes about views into one each, with their number."""
    return [f"{'1 view' if n == 1 else f'{n} views'}: {note}" for note, n in Counter(notes).items()]
