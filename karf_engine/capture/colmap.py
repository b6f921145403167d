"""Read COLMAP captures: a sparse model (see `colmap_model`) and its photos.

COLMAP's optical axis is +z with x right and y down, its poses are world to camera, and its distortion is OpenCV's
(src/colmap/sensor/models.h). Model and photos are searched for in the folders of COLMAP, nerfstudio, Mip-NeRF 360 and 3D
Gaussian Splatting.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath

import numpy as np

from ..errors import DataError
from .camera import LARGEST_POSITION, Camera, read_camera
from .capture import Capture, SparsePoints
from .colmap_model import Image, Intrinsics, Points, count_images, read_cameras, read_images, read_points
from .reader_utils import (
    PHOTO_SUFFIXES,
    at_photo,
    exists,
    make_views,
    merge_notes,
    opencv_distortion,
    photos_in,
)

MODEL_FOLDERS = ("sparse", "colmap/sparse", "dense/sparse", ".", "colmap", "dense")
PHOTO_FOLDERS = ("images", "input", "images_*", "rgb", "photos")
TABLES = ("cameras", "images", "points3D")
MODEL_FILES = {f"{table}{suffix}" for table in (*TABLES, "rigs", "frames") for suffix in (".bin", ".txt")}
IDENTIFYING_FILES = ("cameras.bin", "images.bin", "cameras.txt")  # an images.txt may be any list of images
PINHOLES = ("SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV")
FISHEYES = ("SIMPLE_FISHEYE", "FISHEYE", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "OPENCV_FISHEYE")


def is_colmap(path: Path) -> bool:
    """Test whether `path` is a file of a sparse model, or a folder that is or contains one."""
    return path.name in MODEL_FILES if path.is_file() else any(_models(path))


def read_colmap(path: Path, photos: bool) -> Capture:
    """Read a sparse model (a folder that is or contains one, or a file of one), views sorted by photo name.

    The largest of several models is read. With `photos`, missing photos, and photos without a pose, are skipped with a
    remark. Raises DataError if a file is missing or damaged, or no photo is found.
    """
    model, remarks = _choose_model(path)
    suffix = _suffix(model)
    intrinsics = read_cameras(model / f"cameras{suffix}")
    images = read_images(model / f"images{suffix}")
    points = read_points(model / f"points3D{suffix}") if (model / f"points3D{suffix}").exists() else None
    _check(model, suffix, intrinsics, images, points)
    ids = sorted(images, key=lambda number: images[number].name)
    names = [images[number].name for number in ids]
    found: list[Path | None] = [None] * len(ids)
    if photos:
        found, photo_remarks = _find_photos(model, names)
        remarks += photo_remarks
        ids = [number for number, photo in zip(ids, found, strict=True) if photo]
        found = [photo for photo in found if photo]

    declared = [_camera(images[number], intrinsics[images[number].camera], model / f"images{suffix}") for number in ids]
    sized = [at_photo(camera, photo) for camera, photo in zip(declared, found, strict=True)]
    cameras = [camera for camera, _ in sized]
    stems = [photo.stem if photo else _path(images[n].name).stem for n, photo in zip(ids, found, strict=True)]
    views = make_views(cameras, found, stems, ["train"] * len(ids))
    remarks += merge_notes(note for _, notes in sized for note in notes)
    if points is None:
        remarks.append(f"{model} has no points3D{suffix}, and so there are no sparse points.")
    scales = [(new.width / old.width, new.height / old.height) for new, old in zip(cameras, declared, strict=True)]
    sparse = _sparse_points(points, [images[number] for number in ids], scales) if points is not None else None
    return Capture(path.absolute(), "colmap", tuple(views), tuple(remarks), sparse)


# ---------------------------------------------------------------------------------------------------------------- model
def _models(path: Path) -> Iterator[Path]:
    """Yield the folders of sparse models, siblings together."""
    for place in MODEL_FOLDERS:
        for folder in (path / place, *sorted((path / place).glob("[0-9]*"))):
            if any((folder / name).exists() for name in IDENTIFYING_FILES):
                yield folder


def _choose_model(path: Path) -> tuple[Path, list[str]]:
    if path.is_file():
        return path.parent, []
    found = list(_models(path))
    group = [model for model in found if model.parent == found[0].parent]
    if len(group) == 1:
        return group[0], []
    counts = {model: max(count_images(model / f"images{suffix}") for suffix in (".bin", ".txt")) for model in group}
    best = max(group, key=counts.__getitem__)
    return best, [f"{len(group)} sparse models were found; {best} has the most photos, {counts[best]}, and was read."]


def _suffix(model: Path) -> str:
    """Return .bin or .txt, whichever the model has; as COLMAP, prefer .bin."""
    for suffix in (".bin", ".txt"):
        if all((model / f"{table}{suffix}").exists() for table in ("cameras", "images")):
            return suffix
    present = sorted(file.name for file in model.iterdir() if file.name in MODEL_FILES)
    raise DataError(
        f"{model} has {', '.join(present)}, but not cameras and images both as .bin or both as .txt.",
        "Export the whole model from COLMAP.",
    )


def _check(
    model: Path, suffix: str, intrinsics: dict[int, Intrinsics], images: dict[int, Image], points: Points | None
) -> None:
    """Check the references between tables, and that feature positions are finite."""
    for number, image in images.items():
        if image.camera not in intrinsics:
            raise DataError(
                f"{model / f'images{suffix}'}, image {number} ({image.name!r}) was taken by camera {image.camera}, "
                f"which cameras{suffix} does not hold.",
                "Export all files of the model together.",
            )
        if not np.abs(image.pixels).max(initial=0) <= LARGEST_POSITION:
            raise DataError(
                f"{model / f'images{suffix}'}, image {number} ({image.name!r}) has features that are not finite.",
                "Export the model again.",
            )
    if points is not None and len(unknown := np.setdiff1d(points.seen_by, list(images))):
        raise DataError(
            f"{model / f'points3D{suffix}'} has points seen by image {unknown[0]}, which images{suffix} does not hold.",
            "Export all files of the model together.",
        )


# -------------------------------------------------------------------------------------------------------------- cameras
def _camera(image: Image, source: Intrinsics, file: Path) -> Camera:
    """Return the camera of an image at its declared size."""
    label = f"{file}, image {image.name!r}"
    if source.model not in PINHOLES + FISHEYES:
        raise DataError(
            f"{label} was taken by a {source.model} camera, which is not supported.",
            "Undistort the photos with COLMAP (image_undistorter), or use OPENCV or OPENCV_FISHEYE cameras.",
        )
    values = source.parameters
    fx, fy = values.get("fx", values.get("f")), values.get("fy", values.get("f"))
    fisheye = source.model in FISHEYES
    lens = fx, fy, values["cx"], values["cy"], _camera_to_world(image.pose, label), opencv_distortion(values, fisheye)
    hint = "Export the model again, or leave this image out."
    return read_camera(label, source.width, source.height, *lens, fisheye, hint=hint)


def _camera_to_world(pose: np.ndarray, label: str) -> np.ndarray:
    """Invert a pose (quaternion w x y z, translation), and flip y and z of the camera."""
    if not np.abs(pose).max() <= LARGEST_POSITION or np.linalg.norm(pose[:4]) < 1e-9:
        raise DataError(f"{label} has a pose that is not a rotation and position.", "Leave this image out.")
    w, x, y, z = pose[:4] / np.linalg.norm(pose[:4])
    to_camera = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    camera_to_world = np.eye(4)
    camera_to_world[:3, :3] = to_camera.T * (1, -1, -1)
    camera_to_world[:3, 3] = -to_camera.T @ pose[4:]
    return camera_to_world


# --------------------------------------------------------------------------------------------------------------- photos
def _find_photos(model: Path, names: list[str]) -> tuple[list[Path | None], list[str]]:
    """Return the photo of each sorted image name, all from the folder with the most pairs, and remarks."""
    paths = [_relative(model, name) for name in names]
    # strict rules first; inner folders first, since outer ones may have photos of the same names before undistortion
    for pair in (_by_name, _by_stem, _by_file_name, _by_order):
        for root in _roots(model):
            folders = [folder for name in PHOTO_FOLDERS for folder in sorted(root.glob(name))] + [root]
            pairs = [(folder, pair(folder, paths)) for folder in folders]
            folder, photos = max(pairs, key=lambda entry: sum(map(bool, entry[1])))
            if any(photos):
                guess = [f"Photos in {folder} have other names; they were taken in order."] * (pair is _by_order)
                return photos, guess + _left_out(folder, names, photos)
    raise DataError(
        "{path}: none of its {count} photos was found, the first are {first}.",
        "Put the photos into {folder}.",
        path=model,
        count=len(names),
        first=", ".join(names[:3]),
        folder=list(_roots(model))[-1] / "images",
    )


def _relative(model: Path, name: str) -> PurePosixPath:
    path = _path(name)
    if not path.name or ".." in path.parts or path.is_absolute() or path.parts[0][1:] == ":":
        raise DataError(
            f"{model} has a photo {name!r}, which is not a path below a folder of photos.",
            "Name the photos relative to their folder (COLMAP's image_path).",
        )
    return path


def _roots(model: Path) -> Iterator[Path]:
    """Yield the model's folder and its parents, up to the one that contains `sparse`, `colmap` or `dense`."""
    folder = model.absolute()
    yield folder
    while folder.name.isdigit() or folder.name in ("sparse", "colmap", "dense"):
        folder = folder.parent
        yield folder


def _by_name(folder: Path, paths: Sequence[PurePosixPath]) -> list[Path | None]:
    """Pair photos at the model's path below the folder."""
    return [folder / path if exists(folder / path) else None for path in paths]


def _by_stem(folder: Path, paths: Sequence[PurePosixPath]) -> list[Path | None]:
    """Pair photos at the model's path with another suffix, that is, converted to another file format."""
    choices = ([folder / path.with_suffix(suffix) for suffix in PHOTO_SUFFIXES] for path in paths)
    return [next((photo for photo in photos if exists(photo)), None) for photos in choices]


def _by_file_name(folder: Path, paths: Sequence[PurePosixPath]) -> list[Path | None]:
    """Pair photos by file name alone, for photos of several folders moved into one; not if file names repeat."""
    flat = [PurePosixPath(path.name) for path in paths]
    return _by_name(folder, flat) if len(set(flat)) == len(flat) else [None] * len(paths)


def _by_order(folder: Path, paths: Sequence[PurePosixPath]) -> list[Path | None]:
    """Pair the n-th photo of a folder images* with the n-th name: LLFF's captures rename photos when downsampling."""
    photos = photos_in(folder) if folder.name.startswith("images") else []
    return list(photos) if len(photos) == len(paths) else [None] * len(paths)


def _left_out(folder: Path, names: list[str], photos: list[Path | None]) -> list[str]:
    remarks = []
    missing = [name for name, photo in zip(names, photos, strict=True) if not photo]
    if missing:
        remarks.append(
            f"{len(missing)} of {len(names)} photos are missing and were skipped; the first is {missing[0]}."
        )
    used = {photo for photo in photos if photo}
    unposed = [photo for place in {photo.parent for photo in used} for photo in photos_in(place) if photo not in used]
    if unposed:
        remarks.append(f"{len(unposed)} photos in {folder} have no pose in the model and were left out.")
    return remarks


def _path(name: str) -> PurePosixPath:
    return PurePosixPath(name.replace("\\", "/"))


# --------------------------------------------------------------------------------------------------------------- points
def _sparse_points(points: Points, images: list[Image], scales: list[tuple[float, float]]) -> SparsePoints | None:
    """Return the points with their observations in these images, scaled to the photos' sizes; None without points."""
    if not len(points.ids):
        return None
    order = np.argsort(points.ids)
    view, point, pixels = [], [], []
    for number, (image, scale) in enumerate(zip(images, scales, strict=True)):
        insertion = np.searchsorted(points.ids, image.points, sorter=order)
        index = order[np.minimum(insertion, len(order) - 1)]
        is_match = (points.ids[index] == image.points) & (image.points >= 0)
        view.append(np.full(is_match.sum(), number, np.int32))
        point.append(index[is_match])
        pixels.append(image.pixels[is_match] * scale)
    has_error = (points.errors >= 0) & (points.errors <= LARGEST_POSITION)  # COLMAP writes -1 for none
    return SparsePoints(
        positions=np.array(points.positions, np.float64),
        colors=np.array(points.colors, np.uint8),
        errors=np.where(has_error, points.errors, np.nan).astype(np.float32),
        view=np.concatenate(view),
        point=np.concatenate(point).astype(np.int32),
        pixels=np.concatenate(pixels).astype(np.float32),
    )
