"""Read COLMAP captures: a sparse model (see `colmap_model`) and its photos.

COLMAP's optical axis is +z with x right and y down, its poses are world to camera, and its distortion is OpenCV's
(src/colmap/sensor/models.h). Model and photos are searched for in the folders of COLMAP, nerfstudio, Mip-NeRF 360 and 3D
Gaussian Splatting.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from ..errors import DataError
from ..io.matching import FileFinder, find_entry
from .camera import LARGEST_POSITION, Camera, Panorama, read_camera
from .capture import Capture, SparsePoints
from .colmap_model import Image, Intrinsics, Points, count_images, read_cameras, read_images, read_points
from .distortion import FISHEYE_KEYS, RAD_TAN_KEYS, THIN_PRISM_KEYS
from .radial_lenses import corner_distance, division, field_of_view, fit_fisheye, unified
from .reader_utils import (
    at_photo,
    make_views,
    merge_notes,
    opencv_distortion,
    photos_in,
    pose_of_opencv,
    read_each,
    rotation_of_quaternion,
)

MODEL_FOLDERS = ("sparse", "colmap/sparse", "dense/sparse", ".", "colmap", "dense")
PHOTO_FOLDERS = ("images", "input", "rgb", "photos")
TABLES = ("cameras", "images", "points3D")
MODEL_FILES = {f"{table.lower()}{suffix}" for table in (*TABLES, "rigs", "frames") for suffix in (".bin", ".txt")}
IDENTIFYING_FILES = ("cameras.bin", "images.bin", "cameras.txt")  # an images.txt may be any list of images
PINHOLES = ("SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV")
FISHEYES = ("SIMPLE_FISHEYE", "FISHEYE", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "OPENCV_FISHEYE")
THIN_PRISMS = {"THIN_PRISM_FISHEYE": THIN_PRISM_KEYS, "RAD_TAN_THIN_PRISM_FISHEYE": RAD_TAN_KEYS}
RADIAL = {  # converted to fisheye models
    "FOV": lambda values: field_of_view(values["omega"]),
    "SIMPLE_DIVISION": lambda values: division(values["k"]),
    "DIVISION": lambda values: division(values["k"]),
    "EUCM": lambda values: unified(values["alpha"], values["beta"]),
}


def is_colmap(path: Path) -> bool:
    """Test whether `path` is a file of a sparse model, or a folder that is or contains one."""
    return path.name.lower() in MODEL_FILES if path.is_file() else any(_models(path))


def read_colmap(path: Path, photos: bool) -> Capture:
    """Read a sparse model (a folder that is or contains one, or a file of one), views sorted by photo name.

    The largest of several models is read. With `photos`, missing photos, and photos without a pose, are skipped with a
    remark. Raises DataError if a file is missing or damaged, or no photo is found.
    """
    model, remarks = _choose_model(path)
    suffix = _suffix(model)
    tables = {name: find_entry(model, f"{name}{suffix}") for name in TABLES}
    intrinsics, images = read_cameras(tables["cameras"]), read_images(tables["images"])
    entries: list[tuple[int, Path | None]] = [(n, None) for n in sorted(images, key=lambda n: images[n].name)]
    if photos:
        found, photo_remarks = _find_photos(model, [images[number].name for number, _ in entries])
        entries = [(number, file) for (number, _), file in zip(entries, found, strict=True) if file]
        remarks += photo_remarks
    registered, skip_remarks = read_each(
        entries, lambda entry: _registered(*entry, images, intrinsics, tables["images"]), skip=photos
    )
    cameras, files = [each.camera for each in registered], [each.file for each in registered]
    stems = [each.file.stem if each.file else _path(each.image.name).stem for each in registered]
    views = make_views(cameras, files, stems, ["train"] * len(registered))
    remarks += skip_remarks + merge_notes(note for each in registered for note in each.notes)
    if not tables["points3D"].exists():
        remarks.append(f"{model} has no points3D{suffix}, and so there are no sparse points.")
        return Capture(path.absolute(), "colmap", tuple(views), tuple(remarks))
    points = read_points(tables["points3D"])
    if unknown := len(np.setdiff1d(points.seen_by, list(images))):
        remarks.append(f"{tables['points3D']} has points seen by {unknown} photos that the model lacks.")
    return Capture(path.absolute(), "colmap", tuple(views), tuple(remarks), _sparse_points(points, registered))


# ---------------------------------------------------------------------------------------------------------------- model
def _models(path: Path) -> Iterator[Path]:
    """Yield the folders of sparse models, siblings together."""
    for place in MODEL_FOLDERS:
        outer = path
        for name in PurePosixPath(place).parts:
            outer = find_entry(outer, name)
        for folder in (outer, *sorted(outer.glob("[0-9]*"))):
            if any(find_entry(folder, name).exists() for name in IDENTIFYING_FILES):
                yield folder


def _choose_model(path: Path) -> tuple[Path, list[str]]:
    if path.is_file():
        return path.parent, []
    found = list(_models(path))
    group = [model for model in found if model.parent == found[0].parent]
    if len(group) == 1:
        return group[0], []
    counts = {
        model: max(count_images(find_entry(model, f"images{suffix}")) for suffix in (".bin", ".txt")) for model in group
    }
    best = max(group, key=counts.__getitem__)
    return best, [f"{len(group)} sparse models were found; {best} has the most photos, {counts[best]}, and was read."]


def _suffix(model: Path) -> str:
    """Return .bin or .txt, whichever the model has; as COLMAP, prefer .bin."""
    for suffix in (".bin", ".txt"):
        if all(find_entry(model, f"{table}{suffix}").exists() for table in ("cameras", "images")):
            return suffix
    present = sorted(file.name for file in model.iterdir() if file.name.lower() in MODEL_FILES)
    raise DataError(
        f"{model} has {', '.join(present)}, but not cameras and images both as .bin or both as .txt.",
        "Export the whole model from COLMAP.",
    )


# -------------------------------------------------------------------------------------------------------------- cameras
@dataclass(frozen=True)
class _Registered:
    """An image of the model with its photo, if there is one, and its camera at the photo's size."""

    image: Image
    file: Path | None
    camera: Camera
    scale: tuple[float, float]  # of the photo's width and height to those that the model declares
    notes: list[str]


def _registered(
    number: int, file: Path | None, images: dict[int, Image], intrinsics: dict[int, Intrinsics], table: Path
) -> _Registered:
    image = images[number]
    label = f"{table}, image {number} ({image.name!r})"
    if image.camera not in intrinsics:
        raise DataError(
            f"{label} was taken by camera {image.camera}, which is missing from {table.with_stem('cameras').name}.",
            "Export all files of the model together.",
        )
    declared = _camera(image, intrinsics[image.camera], label)
    camera, notes = at_photo(declared, file)
    return _Registered(image, file, camera, (camera.width / declared.width, camera.height / declared.height), notes)


def _camera(image: Image, source: Intrinsics, label: str) -> Camera:
    """Return the camera of an image at its declared size."""
    if not np.abs(image.pixels).max(initial=0) <= LARGEST_POSITION:
        raise DataError(f"{label} has features that are not finite.", "Export the model again.")
    values, pose = source.parameters, _camera_to_world(image.pose, label)
    if source.model == "EQUIRECTANGULAR":
        return Panorama.of(label, source.width, source.height, pose)
    fx, fy = (values["f"],) * 2 if "f" in values else (values["fx"], values["fy"])
    fisheye = source.model not in PINHOLES
    if source.model in RADIAL:
        corner = corner_distance(source.width, source.height, values["cx"], values["cy"], min(fx, fy))
        factor, distortion = fit_fisheye(label, RADIAL[source.model](values), corner)
        fx, fy = factor * fx, factor * fy
    else:
        distortion = opencv_distortion(values, fisheye, THIN_PRISMS.get(source.model, FISHEYE_KEYS))
    lens = fx, fy, values["cx"], values["cy"], pose, distortion
    hint = "Export the model again, or leave this image out."
    return read_camera(label, source.width, source.height, *lens, fisheye, hint=hint)


def _camera_to_world(pose: np.ndarray, label: str) -> np.ndarray:
    """Invert a pose (quaternion w x y z, translation), and flip y and z of the camera."""
    if not np.abs(pose).max() <= LARGEST_POSITION or np.linalg.norm(pose[:4]) < 1e-9:
        raise DataError(f"{label} has a pose that is not a rotation and position.", "Leave this image out.")
    return pose_of_opencv(rotation_of_quaternion(*map(float, pose[:4])), pose[4:])


# --------------------------------------------------------------------------------------------------------------- photos
def _find_photos(model: Path, names: list[str]) -> tuple[list[Path | None], list[str]]:
    """Return the photo of each image name, all from the folder with the most of them, and remarks."""
    paths = [_relative(model, name) for name in names]
    flat = [PurePosixPath(path.name) for path in paths]  # photos of several folders moved into one
    # strict rules first; inner folders first, since outer ones may have photos of the same names before undistortion
    for wanted in (paths, flat) if len(set(flat)) == len(flat) else (paths,):
        for rule in (FileFinder.exact, FileFinder.matches):
            for root in _roots(model):
                counts = {finder: sum(bool(rule(finder, path)) for path in wanted) for finder in _photo_folders(root)}
                finder = max(counts, key=counts.__getitem__)
                if counts[finder]:
                    photos = [finder.find(path) for path in wanted]
                    return photos, _left_out(finder.root, names, photos)
    raise DataError(
        "{path}: none of its {count} photos was found, the first are {first}.",
        "Put the photos into {folder}, by the names that the model has.",
        path=model,
        count=len(names),
        first=", ".join(names[:3]),
        folder=list(_roots(model))[-1] / "images",
    )


def _photo_folders(root: Path) -> list[FileFinder]:
    """Return finders in the usual folders of photos, the largest of reduced copies first, and in `root` itself."""
    folders = [find_entry(root, name) for name in PHOTO_FOLDERS]
    reduced = sorted(root.glob("[Ii]mages_*"), key=lambda folder: (len(folder.name), folder.name))
    return [FileFinder(folder) for folder in (*folders, *reduced, root)]


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
    while folder.name.isdigit() or folder.name.lower() in ("sparse", "colmap", "dense"):
        folder = folder.parent
        yield folder


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
def _sparse_points(points: Points, registered: list[_Registered]) -> SparsePoints | None:
    """Return the points with their observations, scaled to the photos' sizes; None without points."""
    if not len(points.ids):
        return None
    order = np.argsort(points.ids)
    view, point, pixels = [], [], []
    for number, each in enumerate(registered):
        insertion = np.searchsorted(points.ids, each.image.points, sorter=order)
        index = order[np.minimum(insertion, len(order) - 1)]
        is_match = (points.ids[index] == each.image.points) & (each.image.points >= 0)
        view.append(np.full(is_match.sum(), number, np.int32))
        point.append(index[is_match])
        pixels.append(each.image.pixels[is_match] * each.scale)
    has_error = (points.errors >= 0) & (points.errors <= LARGEST_POSITION)  # COLMAP writes -1 for none
    return SparsePoints(
        positions=np.array(points.positions, np.float64),
        colors=np.array(points.colors, np.uint8),
        errors=np.where(has_error, points.errors, np.nan).astype(np.float32),
        view=np.concatenate(view),
        point=np.concatenate(point).astype(np.int32),
        pixels=np.concatenate(pixels).astype(np.float32),
    )
