"""The pinhole camera and its conventions.

Axes are OpenGL's: x right, y up, the optical axis along -z; `camera_to_world` maps them to the world. Pixels are (u right,
v down) with corners at integers: the first pixel's center is (0.5, 0.5), and the image spans [0, width] x [0, height].
`depth` is the distance along the optical axis, in world units.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np

from ..errors import BadRequest, DataError
from ..io.arguments import check_arguments, check_array, check_fields, check_number
from ..io.image_size import MOST_PIXELS

POSE_TOLERANCE = 1e-3  # deviation of a rotation matrix from orthonormal
IDENTITY = np.eye(4)
LARGEST_POSITION = 1e12  # its square fits single precision
LARGEST_SIDE = 10**6  # pixels
ASPECT_TOLERANCE = 0.01  # of a 360-degree photo's width to twice its height


class Limits(NamedTuple):
    """Allowed ranges of a camera's parameters; lengths in pixels are relative to the longer side."""

    side: float  # largest width and height, pixels
    pixels: float  # largest number of pixels
    focal: tuple[float, float]  # smallest and largest focal length
    center: float  # largest coordinate of the principal point
    coefficient: float  # largest distortion coefficient
    position: float  # largest coordinate of the position
    skew: float  # largest deviation of the rotation from orthonormal


LARGEST = np.finfo(np.float64).max
FINITE = Limits(2**53, math.inf, (np.finfo(np.float64).tiny, LARGEST), LARGEST, LARGEST, LARGEST, math.inf)
# Beyond these, single precision or memory overflows. Focal lengths of fields of view from above 179 degrees to 0.001;
# twice the pose's tolerance, since `reader_utils.rigid_pose` accepts scales that are 1 up to rounding.
USABLE = Limits(LARGEST_SIDE, MOST_PIXELS, (1e-3, 1e6), 1e3, 1e6, LARGEST_POSITION, 2 * POSE_TOLERANCE)


@dataclass(frozen=True, eq=False)
class Camera:
    """Intrinsics, pose and lens distortion of a photo as stored. Cameras are compared by value.

    Attributes:
        width: Image width, pixels.
        height: Image height, pixels.
        fx: Focal length along u, pixels.
        fy: Focal length along v, pixels.
        cx: Principal point along u, pixels; width / 2 if centered.
        cy: Principal point along v, pixels.
        camera_to_world: [4, 4] float64, rotation and position in world units.
        distortion: OpenCV's (k1, k2, p1, p2[, k3[, k4, k5, k6]]), or (k1, k2, k3, k4) of its fisheye model, or the 10 or 12
            values of one with a thin prism; empty for a pinhole. See the module `distortion`.
        fisheye: Whether the distortion is of a fisheye model.

    Raises:
        TypeError: A field has another type than declared.
        BadRequest: A number is not finite, a size or focal length is not positive, or the pose has another shape or is
            mirrored. `check_camera` has the stricter limits of captures.

    Examples:
        >>> camera = Camera(640, 480, 500.0, 500.0, 320.0, 240.0, np.eye(4))
        >>> pixels, depth = camera.project(np.array([[0.0, 0.0, -2.0]]))
        >>> pixels.tolist(), depth.tolist()
        ([[320.0, 240.0]], [2.0])
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    camera_to_world: np.ndarray
    distortion: tuple[float, ...] = ()
    fisheye: bool = False

    def __post_init__(self) -> None:
        check_fields(self)
        check_array("camera_to_world", self.camera_to_world, (4, 4))
        wrong = find_invalid_parameter(self, FINITE)
        if wrong:
            raise BadRequest("The camera has {wrong}, which cannot be.", "Correct it.", wrong=wrong)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Camera) and self._numbers == other._numbers

    def __hash__(self) -> int:
        return hash(self._numbers)

    @property
    def _numbers(self) -> tuple[object, ...]:
        values = [getattr(self, item.name) for item in fields(self)]
        return tuple(value.tobytes() if isinstance(value, np.ndarray) else value for value in values)

    @property
    def is_pinhole(self) -> bool:
        """Whether the camera has no distortion."""
        return not self.fisheye and not any(self.distortion)

    @property
    def position(self) -> np.ndarray:
        """Camera center in the world, [3]."""
        return self.camera_to_world[:3, 3]

    @property
    def world_to_camera(self) -> np.ndarray:
        """Inverse pose, [4, 4]."""
        return np.linalg.inv(self.camera_to_world)

    def without_distortion(self) -> Camera:
        """Return the pinhole camera with the same size, focal lengths, principal point and pose."""
        return replace(self, distortion=(), fisheye=False)

    @check_arguments
    def scaled(self, width: int, height: int) -> Camera:
        """Return the camera for another image size, scaling the intrinsics of each axis. Raises BadRequest below 1."""
        check_number("width", width, 1)
        check_number("height", height, 1)
        sx, sy = width / self.width, height / self.height
        return replace(
            self, width=width, height=height, fx=self.fx * sx, fy=self.fy * sy, cx=self.cx * sx, cy=self.cy * sy
        )

    @check_arguments
    def reduced(self, long_side: int) -> Camera:
        """Return the camera scaled down to at most `long_side` pixels a side. Raises BadRequest below 1."""
        check_number("long_side", long_side, 1)
        factor = min(1.0, long_side / max(self.width, self.height))
        return self.scaled(max(1, round(self.width * factor)), max(1, round(self.height * factor)))

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Project world points [n, 3], ignoring distortion. Raises BadRequest for another shape.

        Returns:
            Pixels [n, 2], and depth [n] in world units, negative behind the camera.
        """
        check_array("points", points, ("n", 3))
        world_to_camera = self.world_to_camera
        local = points @ world_to_camera[:3, :3].T + world_to_camera[:3, 3]
        depth = -local[:, 2]
        pixels = np.stack([self.cx + self.fx * local[:, 0] / depth, self.cy - self.fy * local[:, 1] / depth], -1)
        return pixels, depth

    def rays(self, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the rays through pixels [n, 2], ignoring distortion. Raises BadRequest for another shape.

        Returns:
            Origins [n, 3] and directions [n, 3], float64, world. Directions have unit depth and are not normalized: the
            point at depth d is origin + d * direction.
        """
        check_array("pixels", pixels, ("n", 2))
        x, y = (pixels[:, 0] - self.cx) / self.fx, (self.cy - pixels[:, 1]) / self.fy
        local = np.stack([x, y, -np.ones(len(pixels))], -1)
        directions = local @ self.camera_to_world[:3, :3].T
        return np.broadcast_to(self.position, directions.shape), directions

    def pixel_centers(self) -> np.ndarray:
        """Return the centers of all pixels in row-major order, [height * width, 2]."""
        v, u = np.mgrid[0 : self.height, 0 : self.width]
        return np.stack([u.ravel() + 0.5, v.ravel() + 0.5], -1)


class Panorama(Camera):
    """The camera of a 360-degree photo, an equirectangular picture of the whole sphere; readers return it.

    `open_capture` refuses such photos, and `commands.pinhole` converts them. The picture's center looks along -z; columns are
    the longitude from -180 degrees at the left to 180, with +x in the right half; rows are the latitude from 90 degrees (+y)
    at the top to -90. In axes right, down, forward so do COLMAP (EquirectangularCameraModel, src/colmap/sensor/models.h),
    OpenSfM (SphericalProjection, geometry/camera_projections_functions.h) and Metashape (manual, "Spherical cameras"), and in
    axes right, up, back nerfstudio (cameras/cameras.py).
    """

    @classmethod
    def of(cls, label: str, width: int, height: int, camera_to_world: np.ndarray) -> Panorama:
        """Make the camera. Raises DataError as `check_camera`, or if the picture is not of the whole sphere."""
        if abs(width - 2 * height) > ASPECT_TOLERANCE * width:
            raise DataError(
                f"{label} is a 360-degree photo of {width}x{height} pixels, which is not of the whole sphere.",
                "Give equirectangular photos that are twice as wide as high.",
            )
        focal = width / (2 * math.pi)  # of the picture's center
        camera = cls(width, height, focal, focal, width / 2, height / 2, camera_to_world)
        return cast(Panorama, check_camera(camera, label))


def find_invalid_parameter(camera: Camera, limits: Limits) -> str:
    """Describe the first parameter outside its limits; empty if all are inside. Comparisons fail for nan."""
    width, height, side = camera.width, camera.height, max(camera.width, camera.height)
    size = f"{width}x{height} pixels"
    if not (1 <= width <= limits.side and 1 <= height <= limits.side):
        return f"a picture of {size}"
    if width * height > limits.pixels:
        return f"a picture of {size}, more than {limits.pixels // 10**6} million"
    for name in ("fx", "fy"):
        if not limits.focal[0] <= getattr(camera, name) / side <= limits.focal[1]:
            return f"the focal length {name} {getattr(camera, name):g} at {size}"
    for name in ("cx", "cy"):
        if not abs(getattr(camera, name)) / side <= limits.center:
            return f"the principal point {name} {getattr(camera, name):g} at {size}"
    for value in camera.distortion:
        if not abs(value) <= limits.coefficient:
            return f"the distortion coefficient {value:g}"
    if not np.abs(camera.position).max() <= limits.position:
        return f"the position {', '.join(f'{value:g}' for value in camera.position)}"
    is_pose = is_rigid(camera.camera_to_world, limits.skew)
    return "" if is_pose else "a pose that is not a rotation and a position"


def is_rigid(pose: np.ndarray, tolerance: float = POSE_TOLERANCE) -> bool:
    """Test whether a matrix [4, 4] is a rigid transform, without scale, shear or mirroring."""
    rotation = pose[:3, :3]
    if not np.abs(rotation.T @ rotation - IDENTITY[:3, :3]).max() <= tolerance:
        return False
    x, y, z = rotation.tolist()  # numpy's determinant takes several times as long, for each of thousands of photos
    across = (y[1] * z[2] - y[2] * z[1], y[2] * z[0] - y[0] * z[2], y[0] * z[1] - y[1] * z[0])
    determinant = sum(a * b for a, b in zip(x, across, strict=True))
    return bool(determinant > 0 and np.abs(pose[3] - IDENTITY[3]).max() <= tolerance)


def check_camera(camera: Camera, label: str, hint: str = "Export the cameras again.") -> Camera:
    """Return the camera. Raises DataError "`label` has ..." with the remedy `hint` if it is not within `USABLE`."""
    wrong = find_invalid_parameter(camera, USABLE)
    if wrong:
        raise DataError(f"{label} has {wrong}, which cannot be.", hint)
    return camera


def read_camera(label: str, *args: Any, hint: str = "Export the cameras again.", **kwargs: Any) -> Camera:
    """Make a camera from the arguments of `Camera`. Raises DataError as `check_camera`."""
    try:
        camera = Camera(*args, **kwargs)
    except BadRequest as error:
        wrong = error.sentence.values.get("wrong", error.sentence)
        raise DataError("{label} has {wrong}, which cannot be.", hint, label=label, wrong=wrong) from error
    return check_camera(camera, label, hint)


def wrong_size_error(photo: Path, width: int, height: int, camera: Camera) -> DataError:
    """Return the error for a photo whose size is not its camera's."""
    return DataError(
        "{path} is {width}x{height} pixels where its camera has {expected_width}x{expected_height}.",
        "Import the capture again.",
        path=photo,
        width=width,
        height=height,
        expected_width=camera.width,
        expected_height=camera.height,
    )
