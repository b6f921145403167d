"""Read cameras of RealityScan (RealityCapture): XMP files beside the photos, or a CSV of internal and external parameters.

Format (RealityScan's "Camera geometry", RealityCapture's "XMP camera math", and the export templates in the program's
calibration.xml): positions and rotations of world to camera with axes x right, y down, z forward in XMP; position, heading
(in newer versions yaw), pitch and roll in degrees in CSV. Focal lengths are for film 36 mm wide along the photo's longer
side; the principal point is relative to that side, from the center. Coefficients are k1..k4, t1, t2 of Brown's model on the
plane at depth 1, where t1 is OpenCV's p2 and t2 its p1, or k1 of the division model.
"""

from __future__ import annotations

import csv
import re
from functools import partial
from pathlib import Path, PurePosixPath

import numpy as np

from ..errors import DataError
from .camera import LARGEST_POSITION, Camera, read_camera
from .capture import Capture
from .posed_photos import PHOTO_FOLDERS, PosedPhoto, read_posed
from .radial_lenses import brown_distortion, corner_distance, division, fit_fisheye
from .reader_utils import pose_of_opencv, read_text

FILM = 36.0  # millimeters of the longer side
NAMESPACE = "capturingreality.com/ns/xcr"
HEAD_BYTES = 4096
COLUMNS = {"name", "x", "y", "alt", "heading", "pitch", "roll", "f"}
NEW_COLUMNS = {"yaw": "heading", "f_35mm": "f", "px_norm": "px", "py_norm": "py"}  # of RealityScan 2: their older names
MOST_SKEW = 1e-3  # of the pixels' aspect from 1, and of the skew
AGAIN = "Export the cameras again."


def is_realityscan(path: Path) -> bool:
    """Test whether `path` is such a CSV or XMP file, or a folder with one, or with photos and XMP files."""
    return _is_csv(path) or _is_xmp(path) if path.is_file() else _csv(path) is not None or bool(_xmp_files(path))


def read_realityscan(path: Path, photos: bool) -> Capture:
    """Read the cameras of a CSV, else of all XMP files. Raises DataError if they are damaged or no photo is found."""
    folder = path if path.is_dir() else path.parent
    table = path if _is_csv(path) else _csv(folder)
    posed = _posed_by_csv(table) if table is not None else [_posed_by_xmp(file) for file in _xmp_files(folder)]
    return read_posed(path, "realityscan", posed, folder, photos, [])


def _csv(folder: Path) -> Path | None:
    return next((path for path in sorted(folder.glob("*.csv")) if _is_csv(path)), None)


def _is_csv(path: Path) -> bool:
    if path.suffix.lower() != ".csv" or not path.is_file():
        return False
    with path.open("rb") as stream:
        head = stream.readline(HEAD_BYTES).decode("utf-8-sig", "replace")
    return COLUMNS <= set(_columns(head))


def _columns(line: str) -> list[str]:
    names = (name.strip().lstrip("#").lower() for name in line.split(","))
    return [NEW_COLUMNS.get(name, name) for name in names]


def _is_xmp(path: Path) -> bool:
    if path.suffix.lower() != ".xmp" or not path.is_file():
        return False
    with path.open("rb") as stream:
        return NAMESPACE.encode() in stream.read(HEAD_BYTES)


def _xmp_files(folder: Path) -> list[Path]:
    places = (folder / name for name in PHOTO_FOLDERS)
    return next(
        (files for place in places if (files := [each for each in sorted(place.glob("*.xmp")) if _is_xmp(each)])), []
    )


def _posed_by_csv(file: Path) -> list[PosedPhoto]:
    head, *lines = read_text(file).splitlines()
    names = _columns(head)
    rows = [dict(zip(names, row, strict=False)) for row in csv.reader(lines) if row]
    if not rows:
        raise DataError(f"{file} holds no cameras.", AGAIN)
    for number, row in enumerate(rows, 2):
        if not row.get("name", "").strip():
            raise DataError(f"{file}, line {number} names no photo.", AGAIN)
    return [
        PosedPhoto(
            PurePosixPath(row["name"].replace("\\", "/")), partial(_camera_of_row, f"{file}, line {number}", row)
        )
        for number, row in enumerate(rows, 2)
    ]


def _camera_of_row(label: str, row: dict[str, str], width: int, height: int) -> Camera:
    def number(name: str) -> float:
        try:
            return float(row.get(name) or 0)
        except ValueError as error:
            raise DataError(f"{label} has {name} = {row[name]!r:.100}, which is not a number.", AGAIN) from error

    heading, pitch, roll = (np.radians(number(name)) for name in ("heading", "pitch", "roll"))
    pose = np.eye(4)
    pose[:3, :3] = _turn(2, -heading) @ _turn(0, pitch) @ _turn(1, roll)
    pose[:3, 3] = number("x"), number("y"), number("alt")
    center = number("px"), number("py")
    coefficients = [number(name) for name in ("k1", "k2", "k3", "k4", "t1", "t2")]
    return _camera(label, pose, number("f"), center, "brown", coefficients, width, height)


def _turn(axis: int, angle: float) -> np.ndarray:
    """Return the rotation [3, 3] about a coordinate axis."""
    matrix, (a, b) = np.eye(3), [(1, 2), (2, 0), (0, 1)][axis]
    matrix[[a, b], [a, b]] = np.cos(angle)
    matrix[a, b], matrix[b, a] = -np.sin(angle), np.sin(angle)
    return matrix


def _posed_by_xmp(file: Path) -> PosedPhoto:
    return PosedPhoto(PurePosixPath(file.stem), partial(_camera_of_xmp, file))


def _camera_of_xmp(file: Path, width: int, height: int) -> Camera:
    text = read_text(file)

    def numbers(name: str, count: int, default: list[float] | None = None) -> list[float]:
        found = re.search(rf"xcr:{name}(?:=\"([^\"]*)\"|>([^<]*)<)", text)
        try:
            values = [float(value) for value in (found[1] or found[2] or "").split()] if found else default or []
        except ValueError:
            values = []
        if len(values) < count:
            raise DataError(f"{file} has no {name} of {count} numbers.", "Align the photos, and export them again.")
        return values

    rotation = np.array(numbers("Rotation", 9)[:9]).reshape(3, 3)
    position = np.array(numbers("Position", 3)[:3])
    (focal,), (u,), (v,) = (
        numbers(name, 1, default)[:1]
        for name, default in (("FocalLength35mm", None), ("PrincipalPointU", [0.0]), ("PrincipalPointV", [0.0]))
    )
    model = re.search(r"xcr:DistortionModel=\"(\w+)\"|xcr:DistortionModel>(\w+)<", text)
    kind = (model[1] or model[2]) if model else "perspective"
    coefficients = [*numbers("DistortionCoeficients", 1, [0.0]), *[0.0] * 6][:6]
    if max(abs(numbers("Skew", 1, [0.0])[0]), abs(numbers("AspectRatio", 1, [1.0])[0] - 1)) > MOST_SKEW:
        raise DataError(f"{file} has skewed or oblong pixels.", "Align with a distortion model without K.")
    pose = pose_of_opencv(rotation, -rotation @ position)
    return _camera(str(file), pose, focal, (u, v), kind, coefficients, width, height)


def _camera(
    label: str, pose: np.ndarray, focal: float, center: tuple[float, float], kind: str, coefficients: list[float],
    width: int, height: int,
) -> Camera:  # fmt: skip
    side = max(width, height)
    f, cx, cy = focal / FILM * side, width / 2 + center[0] * side, height / 2 + center[1] * side
    k1, k2, k3, k4, t1, t2 = coefficients
    if not np.abs(pose).max() <= LARGEST_POSITION or not f > 0:
        raise DataError(f"{label} has no pose or focal length.", AGAIN)
    if kind not in ("perspective", "division") and not kind.startswith("brown"):
        raise DataError(f"{label} has a lens of the model {kind}.", "Export with the distortion model Brown3.")
    corner = corner_distance(width, height, cx, cy, f)
    if kind == "division" and k1:
        factor, distortion = fit_fisheye(label, division(k1), corner)
        return read_camera(label, width, height, factor * f, factor * f, cx, cy, pose, distortion, True)
    distortion = brown_distortion(label, (k1, k2, k3, k4), (t2, t1), corner)
    return read_camera(label, width, height, f, f, cx, cy, pose, distortion)
