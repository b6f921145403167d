"""What the readers of all formats share: whole files, checked poses and lenses, photos and their sizes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from ..errors import DataError
from ..io.image_size import LFS_POINTER, image_header
from ..io.inputs import check_file
from ..io.names import file_name
from .camera import Camera, is_rigid
from .capture import View, unique_names
from .limits import LARGEST_POSITION

PHOTO_SUFFIXES = (".png", ".jpg", ".jpeg", ".JPG", ".PNG", ".JPEG", ".webp", ".tif", ".tiff", ".bmp", ".exr")
LENS_KEYS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
FISHEYE_KEYS = ("k1", "k2", "k3", "k4")
UNIT_TOLERANCE = 1e-5  # deviation from orthonormal that single precision explains


# ---------------------------------------------------------------------------------------------------------------- files
def read_bytes(path: Path) -> bytes:
    """The content of a file.

    Raises:
        DataError: The file cannot be read, is empty, or is a Git-LFS pointer.
    """
    check_file(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DataError(
            "{path} cannot be read: {reason}.", "Check the file.", path=path, reason=error.strerror
        ) from error
    if not data:
        raise DataError("{path} is empty.", "Copy the file again.", path=path)
    if data.startswith(LFS_POINTER):
        raise DataError(f"{path} is a Git-LFS pointer, not the file.", "Fetch the files with: git lfs pull.")
    return data


def read_text(path: Path) -> str:
    """The content of a UTF-8 text file.

    Raises:
        DataError: As `read_bytes`, and where it is not UTF-8.
    """
    try:
        return read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DataError(f"{path} is not UTF-8 text: {error.reason}.", "Export or copy the file again.") from error


# ---------------------------------------------------------------------------------------------------------------- poses
def rigid_pose(matrix: np.ndarray, label: str, what: str) -> tuple[np.ndarray, list[str]]:
    """A pose with a pure rotation, of one whose rotation may have a uniform scale.

    Args:
        matrix: camera_to_world, [4, 4] float64.
        label: Whose it is, for messages, which read "`label` has a `what` that ...".
        what: What the file calls it.

    Returns:
        camera_to_world [4, 4] float64, and a note where a scale was removed.

    Raises:
        DataError: The matrix is not finite, is too large for single precision, or has no rotation.
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


def opencv_distortion(coefficients: Mapping[str, float], fisheye: bool) -> tuple[float, ...]:
    """`Camera.distortion` of coefficients by OpenCV's names, absent ones being zero; as short as they allow.

    Examples:
        >>> opencv_distortion({"k1": 0.1, "p2": -0.01}, fisheye=False)
        (0.1, 0.0, 0.0, -0.01)
    """
    values = [float(coefficients.get(key, 0.0)) for key in (FISHEYE_KEYS if fisheye else LENS_KEYS)]
    lengths = (0, 4) if fisheye else (0, 4, 5, 8)
    return tuple(values[: next(length for length in lengths if not any(values[length:]))])


# --------------------------------------------------------------------------------------------------------------- photos
def photos_in(folder: Path) -> list[Path]:
    """The photos that lie directly in a folder, by name; none where there is no such folder."""
    if not folder.is_dir():
        return []
    files = (path for path in folder.iterdir() if path.suffix.lower() in PHOTO_SUFFIXES and path.name[0] != ".")
    return sorted(path for path in files if path.is_file())


def exists(path: Path) -> bool:
    """Whether this is a file; False for names that the file system cannot hold."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def photo_size(image: Path, declared: tuple[int, int] | None) -> tuple[int, int]:
    """Width and height of a photo in the orientation that its camera was made for.

    Args:
        image: The photo.
        declared: Width and height that the capture's file declares, if any.

    Returns:
        The size as shown; as stored where the declared sides are in the order of the stored ones.

    Raises:
        DataError: The photo is missing or damaged.
    """
    header = image_header(image)
    if declared and header.swaps_sides and (declared[0] > declared[1]) == (header.width > header.height):
        return header.stored
    return header.shown


def at_size(camera: Camera, size: tuple[int, int]) -> tuple[Camera, list[str]]:
    """The camera with intrinsics for its photo's real size (width, height), and a note where they had to be scaled."""
    if size == (camera.width, camera.height):
        return camera, []
    note = f"photos are {size[0]}x{size[1]} where the file says {camera.width}x{camera.height}; "
    return camera.scaled(*size), [note + "their intrinsics were scaled."]


# ---------------------------------------------------------------------------------------------------------------- views
def make_views(
    cameras: Iterable[Camera], images: Iterable[Path | None], stems: Iterable[str], splits: Iterable[str]
) -> list[View]:
    """Views with names that are unique and can be files' names.

    Args:
        cameras: One a view.
        images: Their photos; None for bare cameras.
        stems: What to name them after.
        splits: `train`, `val` or `test` of each.
    """
    cameras, images, stems, splits = list(cameras), list(images), list(map(file_name, stems)), list(splits)
    names = unique_names(list(zip(splits, stems, strict=True)))
    return [
        View(name, stem, camera, image.absolute() if image else None, split)
        for name, stem, camera, image, split in zip(names, stems, cameras, images, splits, strict=True)
    ]


def merge_notes(notes: Iterable[str]) -> list[str]:
    """Each different note about views once, with the number of views it holds for."""
    return [f"{'1 view' if n == 1 else f'{n} views'}: {note}" for note, n in Counter(notes).items()]
