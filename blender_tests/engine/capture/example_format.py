"""A capture format in one file: `cameras.csv`, with one row per photo, beside the photos.

Its columns: photo (a path from the file's folder), width and height (pixels), focal (pixels), and camera_to_world
(the 16 numbers of the matrix row by row, with spaces between; x right, y up, the camera looks down -z).
"""

import csv
from pathlib import Path

import numpy as np

from karf_engine.capture import Camera, Capture, Format
from karf_engine.capture.camera import read_camera
from karf_engine.capture.reader_utils import at_photo, make_views, merge_notes, read_text, rigid_pose
from karf_engine.errors import DataError

NAME = "cameras.csv"


def is_csv(path: Path) -> bool:
    """Whether `path` is a cameras.csv, or a folder with one."""
    return path.name == NAME if path.is_file() else (path / NAME).is_file()


def read_csv(path: Path, photos: bool) -> Capture:
    """Read the cameras; every 8th view is a test view. Raises DataError naming the file and the row."""
    file = path if path.is_file() else path / NAME
    rows = list(csv.DictReader(read_text(file).splitlines()))
    images = [file.parent / row["photo"] if photos else None for row in rows]
    read = [_camera(row, image, f"{file}, row {n}") for n, (row, image) in enumerate(zip(rows, images, strict=True), 1)]
    cameras = [camera for camera, _ in read]
    views = make_views(cameras, images, [Path(row["photo"]).stem for row in rows], ["train"] * len(rows))
    remarks = merge_notes(note for _, notes in read for note in notes)
    return Capture(path.absolute(), "csv", tuple(views), tuple(remarks))


def _camera(row: dict[str, str], image: Path | None, label: str) -> tuple[Camera, list[str]]:
    """The camera of a row at its photo's size, and notes on what was changed."""
    try:
        width, height, focal = int(row["width"]), int(row["height"]), float(row["focal"])
        matrix = np.array(row["camera_to_world"].split(), np.float64).reshape(4, 4)
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{label} cannot be read: {error}.", "Correct it in the file.") from error
    pose, notes = rigid_pose(matrix, label, "camera_to_world")
    lens = {"fx": focal, "fy": focal, "cx": width / 2, "cy": height / 2}
    camera = read_camera(label, width=width, height=height, camera_to_world=pose, **lens)
    camera, resized = at_photo(camera, image)
    return camera, notes + resized


CSV = Format("csv", NAME, "it was written by hand", is_csv, read_csv)
