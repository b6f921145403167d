"""Read the tables cameras, images and points3D of a COLMAP sparse model, binary and text, with numpy only.

Format: COLMAP's documentation, "Output Format", and the camera models of src/colmap/sensor/models.h (4.2). Pixel corners
are at integers. The rigs and frames of newer versions repeat the images' poses and are not read.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import DataError
from ..io.files import check_file
from .camera import LARGEST_POSITION
from .reader_utils import read_bytes, read_text

AGAIN = "Copy the file again, or export the model again from COLMAP."
MODELS = {  # id: (camera model, parameters in file order; coefficients of polynomials and prisms by OpenCV's names)
    0: ("SIMPLE_PINHOLE", "f cx cy"),
    1: ("PINHOLE", "fx fy cx cy"),
    2: ("SIMPLE_RADIAL", "f cx cy k1"),
    3: ("RADIAL", "f cx cy k1 k2"),
    4: ("OPENCV", "fx fy cx cy k1 k2 p1 p2"),
    5: ("OPENCV_FISHEYE", "fx fy cx cy k1 k2 k3 k4"),
    6: ("FULL_OPENCV", "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6"),
    7: ("FOV", "fx fy cx cy omega"),
    8: ("SIMPLE_RADIAL_FISHEYE", "f cx cy k1"),
    9: ("RADIAL_FISHEYE", "f cx cy k1 k2"),
    10: ("THIN_PRISM_FISHEYE", "fx fy cx cy k1 k2 p1 p2 k3 k4 s1 s3"),
    11: ("RAD_TAN_THIN_PRISM_FISHEYE", "fx fy cx cy k1 k2 k3 k4 k5 k6 p2 p1 s1 s2 s3 s4"),
    12: ("SIMPLE_DIVISION", "f cx cy k"),
    13: ("DIVISION", "fx fy cx cy k"),
    14: ("SIMPLE_FISHEYE", "f cx cy"),
    15: ("FISHEYE", "fx fy cx cy"),
    16: ("EUCM", "fx fy cx cy alpha beta"),
    17: ("EQUIRECTANGULAR", "w h"),
}
PARAMETERS = dict(MODELS.values())
OBSERVATION = np.dtype([("pixel", "<f8", 2), ("point", "<i8")])
POINT = np.dtype([("id", "<i8"), ("position", "<f8", 3), ("color", "u1", 3), ("error", "<f8"), ("length", "<u8")])
TRACK = np.dtype([("image", "<u4"), ("observation", "<u4")])
SMALLEST_IMAGE = 73  # bytes of an entry with an empty name and no features


@dataclass(frozen=True)
class Intrinsics:
    """An entry of cameras: size in pixels, camera model, and its parameters by the names in `MODELS`."""

    width: int
    height: int
    model: str
    parameters: dict[str, float]


@dataclass(frozen=True)
class Image:
    """An entry of images: a registered photo."""

    name: str  # path below the photo folder
    camera: int  # id
    pose: np.ndarray  # world to camera, quaternion (w, x, y, z) and translation, [7] float64
    pixels: np.ndarray  # features, [n, 2] float64
    points: np.ndarray  # point ids of the features, [n] int64, negative for none


@dataclass(frozen=True)
class Points:
    """The table points3D."""

    ids: np.ndarray  # [n] int64
    positions: np.ndarray  # [n, 3] float64, world
    colors: np.ndarray  # [n, 3] uint8
    errors: np.ndarray  # mean reprojection errors in pixels, [n] float64
    seen_by: np.ndarray  # image ids of all tracks, [m] int64


def read_cameras(path: Path) -> dict[int, Intrinsics]:
    """Read cameras.bin or cameras.txt by id. Raises DataError if the file is missing, damaged or empty."""
    return _unique(path, "camera", _cameras_binary(path) if path.suffix == ".bin" else _cameras_text(path))


def read_images(path: Path) -> dict[int, Image]:
    """Read images.bin or images.txt by id. Raises DataError if the file is missing, damaged or empty."""
    return _unique(path, "image", _images_binary(path) if path.suffix == ".bin" else _images_text(path))


def read_points(path: Path) -> Points:
    """Read points3D.bin or points3D.txt. Raises DataError if the file is missing or damaged, or repeats an id."""
    points = _points_binary(path) if path.suffix == ".bin" else _points_text(path)
    if len(np.unique(points.ids)) != len(points.ids):
        raise DataError(f"{path} has two points of one id.", AGAIN)
    if not np.abs(points.positions).max(initial=0) <= LARGEST_POSITION:
        raise DataError(f"{path} has a point whose position is not finite.", AGAIN)
    return points


def count_images(path: Path) -> int:
    """Return the number of photos in images.bin or images.txt; 0 if it is damaged."""
    try:
        if path.suffix == ".txt":
            return len(read_images(path))
        size = check_file(path)
        with path.open("rb") as stream:
            count = int.from_bytes(stream.read(8), "little")
        return count if count <= size // SMALLEST_IMAGE else 0
    except (DataError, OSError):
        return 0


def _unique(path: Path, what: str, entries: Iterator[tuple[int, Any]]) -> dict[int, Any]:
    table: dict[int, Any] = {}
    for number, entry in entries:
        if number in table:
            raise DataError(f"{path} has two entries of {what} {number}.", AGAIN)
        table[number] = entry
    if not table:
        raise DataError(f"{path} holds no {what}s.", AGAIN)
    return table


def _intrinsics(path: Path, number: int, model: str, width: int, height: int, values: tuple[float, ...]) -> Intrinsics:
    names = PARAMETERS[model].split()
    if len(values) != len(names):
        raise DataError(
            f"{path}, camera {number} has {len(values)} parameters where {model} has {len(names)}: {', '.join(names)}.",
            AGAIN,
        )
    return Intrinsics(width, height, model, dict(zip(names, values, strict=True)))


# --------------------------------------------------------------------------------------------------------------- binary
class _BinaryFile:
    """Content of a little-endian file, and a read position. Raises DataError beyond the end; `what` names the entry."""

    def __init__(self, path: Path) -> None:
        self.path, self.data, self.position = path, read_bytes(path), 0

    def entries(self, what: str) -> Iterator[str]:
        """Read the number of entries and yield a label for each; raises DataError if bytes are left at the end."""
        (count,) = self.values("Q", f"the number of {what}s")
        for number in range(count):
            yield f"{what} {number + 1} of {count}"
        if self.position != len(self.data):
            n_left = len(self.data) - self.position
            raise DataError(f"{self.path} has {n_left} bytes after its last {what}.", AGAIN)

    def skip(self, size: int, what: str) -> int:
        """Advance by `size` bytes and return the old position."""
        start, self.position = self.position, self.position + size
        if self.position > len(self.data):
            raise DataError(f"{self.path} is cut off at byte {len(self.data)}, within {what}.", AGAIN)
        return start

    def values(self, layout: str, what: str) -> tuple:
        """Read values of a `struct` layout."""
        return struct.unpack_from("<" + layout, self.data, self.skip(struct.calcsize("<" + layout), what))

    def table(self, dtype: np.dtype, count: int, what: str) -> np.ndarray:
        """Read `count` records as a view of the file's bytes."""
        return np.frombuffer(self.data, dtype, count, self.skip(dtype.itemsize * count, what))

    def text(self, what: str) -> str:
        """Read a zero-terminated UTF-8 string."""
        end = self.data.find(b"\0", self.position)
        start = self.skip((end if end >= 0 else len(self.data)) + 1 - self.position, what)
        try:
            return self.data[start : self.position - 1].decode("utf-8")
        except UnicodeDecodeError as error:
            raise DataError(f"{self.path} has a name that is not UTF-8 text in {what}.", AGAIN) from error


def _cameras_binary(path: Path) -> Iterator[tuple[int, Intrinsics]]:
    file = _BinaryFile(path)
    for what in file.entries("camera"):
        number, model, width, height = file.values("IiQQ", what)
        if model not in MODELS:
            raise DataError(
                f"{path}, camera {number} has the camera model id {model}, which is unknown.",
                "Convert the model to OPENCV cameras, or undistort the photos with COLMAP.",
            )
        name, parameters = MODELS[model]
        yield number, _intrinsics(path, number, name, width, height, file.values(f"{len(parameters.split())}d", what))


def _images_binary(path: Path) -> Iterator[tuple[int, Image]]:
    file = _BinaryFile(path)
    for what in file.entries("image"):
        number, *pose, camera = file.values("I7dI", what)
        name = file.text(what)
        (count,) = file.values("Q", what)
        features = file.table(OBSERVATION, count, what)
        yield number, Image(name, camera, np.array(pose), features["pixel"], features["point"])


def _points_binary(path: Path) -> Points:
    """Split the file by track lengths and parse all points at once: models have up to millions of points."""
    file = _BinaryFile(path)
    heads, tracks = [], []
    for what in file.entries("point"):
        track = file.position + POINT.itemsize
        end = track + TRACK.itemsize * int.from_bytes(file.data[track - 8 : track], "little")
        heads.append(file.data[file.position : track])
        tracks.append(file.data[track:end])
        file.skip(end - file.position, what)
    points, observations = np.frombuffer(b"".join(heads), POINT), np.frombuffer(b"".join(tracks), TRACK)
    image_ids = observations["image"].astype(np.int64)
    return Points(points["id"], points["position"], points["color"], points["error"], image_ids)


# ----------------------------------------------------------------------------------------------------------------- text
def _rows(path: Path, blank: bool = False) -> Iterator[tuple[int, str]]:
    """Yield numbered lines without comments, and without blank ones unless `blank`."""
    for number, line in enumerate(read_text(path).split("\n"), 1):
        if not line.lstrip().startswith("#") and (blank or line.strip()):
            yield number, line


@contextmanager
def _line(path: Path, number: int, what: str) -> Iterator[None]:
    try:
        yield
    except (ValueError, IndexError, OverflowError) as error:
        raise DataError(f"{path}, line {number} does not hold {what}.", AGAIN) from error


def _cameras_text(path: Path) -> Iterator[tuple[int, Intrinsics]]:
    for line, text in _rows(path):
        with _line(path, line, "CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]"):
            camera_id, model, *sizes = text.split()
            number, width, height, values = int(camera_id), int(sizes[0]), int(sizes[1]), tuple(map(float, sizes[2:]))
        if model not in PARAMETERS:
            raise DataError(
                f"{path}, camera {number} has the camera model {model}, which is unknown.",
                "Convert the model to OPENCV cameras, or undistort the photos with COLMAP.",
            )
        yield number, _intrinsics(path, number, model, width, height, values)


def _images_text(path: Path) -> Iterator[tuple[int, Image]]:
    """Read two lines per image; the second is blank without features."""
    rows = _rows(path, blank=True)
    for line, text in rows:
        if not text.strip():
            continue
        with _line(path, line, "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME"):
            image_id, *values, camera_id, name = text.split(maxsplit=9)
            number, camera, pose = int(image_id), int(camera_id), np.array(values, np.float64).reshape(7)
        line, text = next(rows, (line + 1, ""))
        with _line(path, line, "the features (X Y POINT3D_ID)[] of the image before it"):
            features = np.array(text.split(), np.float64).reshape(-1, 3)
        is_point = (features[:, 2] >= 0) & (features[:, 2] < 2.0**62)  # -1 or 2^64 - 1 mean none
        points = np.where(is_point, features[:, 2], -1).astype(np.int64)
        yield number, Image(name.strip(), camera, pose, features[:, :2], points)


def _points_text(path: Path) -> Points:
    ids, heads, seen = [], [], []
    for line, text in _rows(path):
        with _line(path, line, "POINT3D_ID X Y Z R G B ERROR (IMAGE_ID POINT2D_IDX)[]"):
            number, *values = text.split()
            heads.append([float(value) for value in values[:7]])
            ids.append(np.int64(int(number)))
            seen.extend(map(int, values[7::2]))
            if len(values) < 7 or len(values) % 2 == 0 or not all(0 <= value <= 255 for value in heads[-1][3:6]):
                raise ValueError
    table = np.array(heads, np.float64).reshape(-1, 7)
    return Points(
        ids=np.array(ids, np.int64),
        positions=table[:, :3],
        colors=table[:, 3:6].astype(np.uint8),
        errors=table[:, 6],
        seen_by=np.array(seen, np.int64),
    )
