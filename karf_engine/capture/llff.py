"""Read LLFF captures: `poses_bounds.npy` beside the photos.

Format (LLFF's README, "Using your own poses without running COLMAP"): [n, 17] float64, one row per photo in the order of
the names: a 3x5 matrix in row-major order, then nearest and farthest depth. The matrix's columns are the camera's axes
down, right and back in the world, its position, and (height, width, focal length) in pixels. NeX writes [n, 14] with a
3x4 matrix, and (height, width, fx, fy, cx, cy) of all photos in `hwf_cxcy.npy`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import DataError, is_out_of_memory
from ..io.image_size import image_size
from ..io.matching import find_entry
from .camera import LARGEST_POSITION, Camera, read_camera
from .capture import Capture
from .reader_utils import at_photo, make_views, merge_notes, photos_in, read_bytes, read_each, rigid_pose

POSES = "poses_bounds.npy"
SHARED_INTRINSICS = "hwf_cxcy.npy"


def is_llff(path: Path) -> bool:
    """Test whether `path` is a poses_bounds.npy or a folder with one."""
    return path.name.lower() == POSES if path.is_file() else find_entry(path, POSES).exists()


def read_llff(path: Path, photos: bool) -> Capture:
    """Read an LLFF capture (its folder, or poses_bounds.npy); depth bounds are in world units.

    Photos come from the `images*` folder with one photo per pose, the one with the largest photos. Without `photos`,
    views are named by row. Raises DataError if a file is missing or damaged.
    """
    file = path if path.is_file() else find_entry(path, POSES)
    table = _table(file)
    images = _photos(file, len(table)) if photos else [None] * len(table)
    shared = _shared_intrinsics(file) if table.shape[1] == 14 else None

    def read(number: int) -> tuple[int, Camera, list[str]]:
        camera, notes = _camera(table[number], shared, f"{file}, row {number}")
        camera, size_notes = at_photo(camera, images[number])
        return number, camera, notes + size_notes

    entries, remarks = read_each(range(len(table)), read, skip=photos)
    numbers = [number for number, *_ in entries]
    notes = [note for *_, own in entries for note in own]
    rows, files = table[numbers], [images[number] for number in numbers]
    stems = [image.stem if image else f"{number:03d}" for number, image in zip(numbers, files, strict=True)]
    views = make_views([camera for _, camera, _ in entries], files, stems, ["train"] * len(numbers))
    is_range = (rows[:, -2] > 0) & (rows[:, -1] > rows[:, -2]) & (rows[:, -1] <= LARGEST_POSITION)
    views = [
        replace(view, depth_bounds=(float(row[-2]), float(row[-1])) if usable else None)
        for view, row, usable in zip(views, rows, is_range, strict=True)
    ]
    notes += ["depth bounds that are not a range of positive depths were left out."] * int((~is_range).sum())
    return Capture(path.absolute(), "llff", tuple(views), (*remarks, *merge_notes(notes)))


def _table(file: Path) -> np.ndarray:
    table = _load(file)
    if table.ndim != 2 or table.shape[1] not in (14, 17) or not len(table):
        raise DataError(
            f"{file} holds an array of shape {table.shape}, not one row of 17 (or, of NeX, 14) numbers for each photo.",
            "Export the poses again, for example with LLFF's imgs2poses.py.",
        )
    return table


def _load(file: Path) -> np.ndarray:
    """Read an .npy file as float64, by a memory map that checks the header against the file's length."""
    length = len(read_bytes(file))
    try:
        stored = np.lib.format.open_memmap(file, mode="r")
        if stored.size > length:  # items of zero bytes
            raise ValueError("it holds no numbers")
        return np.array(stored, np.float64)
    except Exception as error:  # numpy raises nearly anything for damaged headers
        if is_out_of_memory(error):
            raise
        raise DataError(
            f"{file} is not a complete array of numbers: {str(error).rstrip('.') or type(error).__name__}.",
            "Copy or export the file again.",
        ) from error


def _shared_intrinsics(file: Path) -> np.ndarray:
    """Read (height, width, fx, fy, cx, cy) beside poses of 14 columns."""
    sidecar = find_entry(file.parent, SHARED_INTRINSICS)
    if not sidecar.exists():
        raise DataError(
            f"{file} has 14 columns, poses without focal lengths, and no {SHARED_INTRINSICS} lies beside it.",
            f"Put {SHARED_INTRINSICS} (height, width, fx, fy, cx, cy) beside it, or export 17 columns.",
        )
    values = _load(sidecar).ravel()
    if len(values) == 3:
        height, width, focal = values
        return np.array([height, width, focal, focal, width / 2, height / 2])
    if len(values) != 6:
        raise DataError(
            f"{sidecar} holds {len(values)} numbers, not the six of height, width, fx, fy, cx, cy.",
            "Export the cameras again.",
        )
    return values


def _camera(row: np.ndarray, shared: np.ndarray | None, label: str) -> tuple[Camera, list[str]]:
    block = row[:-2].reshape(3, -1)
    down, right, back, position = block[:, :4].T
    pose = np.eye(4)
    pose[:3] = np.stack([right, -down, back, position], 1)
    pose, notes = rigid_pose(pose, label, "pose")
    if shared is None:
        height, width, focal = block[:, 4]
        shared = np.array([height, width, focal, focal, width / 2, height / 2])
    height, width, fx, fy, cx, cy = map(float, shared)
    if not (math.isfinite(width) and math.isfinite(height)):
        raise DataError(f"{label} has a picture of {width:g}x{height:g} pixels, which cannot be.", "Export them again.")
    return read_camera(label, round(width), round(height), fx, fy, cx, cy, pose), notes


def _photos(file: Path, count: int) -> list[Path]:
    """Return `count` sorted photos of the `images*` folder with exactly as many; of several, the largest photos."""
    folder = file.parent
    candidates = sorted(folder.glob("[Ii]mages*")) or [folder]
    by_folder = {candidate: photos for candidate in candidates if (photos := photos_in(candidate))}
    if not by_folder:
        raise DataError(
            "{path} has {count} poses, but no photos lie in {place}.",
            "Put the photos into {folder}.",
            path=file,
            count=count,
            place=candidates[0],
            folder=folder / "images",
        )
    complete = [photos for photos in by_folder.values() if len(photos) == count]
    if not complete:
        counts = ", ".join(f"{place.name} has {len(photos)} photos" for place, photos in by_folder.items())
        raise DataError(
            f"{file} has {count} poses, but {counts}.", "Poses and photos belong together in the order of the names."
        )
    if len(complete) == 1:
        return complete[0]
    return max(complete, key=lambda photos: np.prod(image_size(photos[0])))
