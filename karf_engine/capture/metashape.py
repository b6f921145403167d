"""Read Metashape's cameras: the XML of *File > Export > Export Cameras* beside the photos.

Format (Metashape's manual, "Camera models", and the exported files): a camera's transform is camera to chunk with axes x
right, y down, z forward, followed by that of its component. Focal length, principal point (from the center) and b1, b2 are
in pixels; p1 and p2 have OpenCV's other order. The lens types are frame (with k1..k4), fisheye (of equal angles) and
spherical (see `Panorama`), which needs no calibration.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from functools import partial
from pathlib import Path, PurePosixPath

import numpy as np

from ..errors import DataError
from .camera import Camera, Panorama, read_camera
from .capture import Capture
from .distortion import THIN_PRISM_KEYS
from .posed_photos import PosedPhoto, read_posed
from .radial_lenses import brown_distortion, corner_distance
from .reader_utils import opencv_distortion, read_bytes, rigid_pose

HEAD_BYTES = 4096
OFF = ("false", "0")
FISHEYE = ("fisheye", "equidistant_fisheye")
MOST_SKEW = 1.0  # pixels over the picture's height


def is_metashape(path: Path) -> bool:
    """Test whether `path` is an XML of cameras, or a folder with one."""
    return _is_cameras(path) if path.is_file() else any(map(_is_cameras, path.glob("*.xml")))


def read_metashape(path: Path, photos: bool) -> Capture:
    """Read the first chunk with aligned cameras; photos are found by the cameras' labels.

    Raises DataError if the file is damaged, or no photo is found.
    """
    file = path if path.is_file() else next(each for each in sorted(path.glob("*.xml")) if _is_cameras(each))
    try:
        root = ElementTree.fromstring(read_bytes(file))
    except ElementTree.ParseError as error:
        raise DataError(f"{file} is no complete XML: {error}.", "Export the cameras again.") from error
    chunk = next((chunk for chunk in root.iter("chunk") if chunk.find(".//camera/transform") is not None), None)
    if chunk is None:
        raise DataError(f"{file} holds no aligned cameras.", "Align the photos in Metashape, and export them again.")
    sensors = {sensor.get("id"): sensor for sensor in chunk.iter("sensor")}
    components = {each.get("id"): each for each in chunk.iter("component")}
    cameras = [each for each in chunk.iter("camera") if each.get("label")]
    aligned = [each for each in cameras if each.find("transform") is not None and each.get("enabled") not in OFF]
    posed = [
        PosedPhoto(
            PurePosixPath(camera.get("label", "").replace("\\", "/")),
            partial(_camera, f"{file}, camera {camera.get('label')!r}", camera, sensors, components),
            _size(sensors.get(camera.get("sensor_id"))),
        )
        for camera in aligned
    ]
    left_out = len(cameras) - len(aligned)
    remarks = [f"{left_out} of {len(cameras)} photos are not aligned and were left out."] if left_out else []
    return read_posed(path, "metashape", posed, file.parent, photos, remarks)


def _is_cameras(path: Path) -> bool:
    if path.suffix.lower() != ".xml" or not path.is_file():
        return False
    with path.open("rb") as stream:
        return b"<chunk" in stream.read(HEAD_BYTES)


def _size(sensor: ElementTree.Element | None) -> tuple[int, int] | None:
    resolution = sensor.find("resolution") if sensor is not None else None
    if resolution is None:
        return None
    try:
        return int(resolution.get("width", "")), int(resolution.get("height", ""))
    except ValueError:
        return None


def _camera(
    label: str,
    camera: ElementTree.Element,
    sensors: dict[str | None, ElementTree.Element],
    components: dict[str | None, ElementTree.Element],
    width: int,
    height: int,
) -> Camera:
    sensor = sensors.get(camera.get("sensor_id"))
    calibration = _calibration(sensor)
    kind = "frame" if sensor is None else sensor.get("type", "frame")
    pose = _component(components.get(camera.get("component_id")), label) @ _matrix(camera, "transform", 16, label)
    pose[:3, 1:3] *= -1
    pose, _ = rigid_pose(pose, label, "transform")
    if kind == "spherical":
        return Panorama.of(label, width, height, pose)
    if calibration is None or kind not in ("frame", *FISHEYE):
        raise DataError(f"{label} has a {kind} sensor without a calibration.", "Export undistorted photos.")
    value = partial(_number, calibration, label)
    f, is_fisheye = value("f"), kind in FISHEYE
    if abs(value("b2")) * height / max(f, 1) > MOST_SKEW or value("p3") or value("p4"):
        raise DataError(f"{label} has a skewed lens (b2, p3 or p4).", "Export undistorted photos.")
    cx, cy = width / 2 + value("cx"), height / 2 + value("cy")
    k1, k2, k3, k4, p2, p1 = (value(name) for name in ("k1", "k2", "k3", "k4", "p1", "p2"))
    if is_fisheye:
        named = {"k1": k1, "k2": k2, "k3": k3, "k4": k4, "p1": p1, "p2": p2}
        distortion = opencv_distortion(named, True, THIN_PRISM_KEYS)
    else:
        corner = corner_distance(width, height, cx, cy, f)
        distortion = brown_distortion(label, (k1, k2, k3, k4), (p1, p2), corner)
    return read_camera(label, width, height, f + value("b1"), f, cx, cy, pose, distortion, is_fisheye)


def _calibration(sensor: ElementTree.Element | None) -> ElementTree.Element | None:
    """Return the adjusted calibration of a sensor, else its initial one."""
    found = [] if sensor is None else sensor.findall("calibration")
    return next((each for each in found if each.get("class") == "adjusted"), found[0] if found else None)


def _component(component: ElementTree.Element | None, label: str) -> np.ndarray:
    matrix = np.eye(4)
    transform = component.find("transform") if component is not None else None
    if transform is None or transform.find("rotation") is None:
        return matrix
    scale = _number(transform, label, "scale") or 1.0
    matrix[:3, :3] = scale * _matrix(transform, "rotation", 9, label)
    if transform.find("translation") is not None:
        matrix[:3, 3] = _matrix(transform, "translation", 3, label)
    return matrix


def _number(element: ElementTree.Element, label: str, name: str) -> float:
    try:
        return float(element.findtext(name, "0"))
    except ValueError as error:
        raise DataError(f"{label} has a {name} that is not a number.", "Export the cameras again.") from error


def _matrix(element: ElementTree.Element, name: str, count: int, label: str) -> np.ndarray:
    try:
        values = np.array(element.findtext(name, "").split(), np.float64)
    except ValueError:
        values = np.empty(0)
    if len(values) != count:
        raise DataError(f"{label} has a {name} without {count} numbers.", "Export the cameras again.")
    return values if count == 3 else values.reshape(int(count**0.5), -1)
