"""The pinhole camera, with the conventions stated once.

Axes: OpenGL/Blender. The camera looks down its -z, x points right, y up; `camera_to_world` maps them to the world.
Pixels: (u right, v down), corners at integers, so the first pixel's center is (0.5, 0.5) and the image spans
[0, width] x [0, height]. `depth` is the distance along the optical axis, in world units.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import DataError


@dataclass(frozen=True)
class Camera:
    """One photo's camera: size and intrinsics in pixels, pose, and the lens distortion of the photo as stored.

    Attributes:
        width: Of the picture, pixels.
        height: Of the picture, pixels.
        fx: Focal length along u, pixels.
        fy: Focal length along v, pixels.
        cx: Principal point along u, pixels; width / 2 where it is centered.
        cy: Principal point along v, pixels.
        camera_to_world: [4, 4] float64, a rotation and the camera's position in world units.
        distortion: OpenCV's (k1, k2, p1, p2[, k3[, k4, k5, k6]]), or (k1, k2, k3, k4) of its fisheye model; empty for a
            plain pinhole. The formulas are those of `distortion`.
        fisheye: Whether the lens is of OpenCV's fisheye model.

    Examples:
        A point straight ahead lies at the principal point:

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

    @property
    def is_pinhole(self) -> bool:
        """Whether the photo shows what a plain pinhole would."""
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
        """The pinhole with this camera's size, focal lengths, principal point and pose."""
        return replace(self, distortion=(), fisheye=False)

    def scaled(self, width: int, height: int) -> Camera:
        """The same view at another picture size: intrinsics follow the size, each axis by its own factor."""
        sx, sy = width / self.width, height / self.height
        return replace(
            self, width=width, height=height, fx=self.fx * sx, fy=self.fy * sy, cx=self.cx * sx, cy=self.cy * sy
        )

    def reduced(self, long_side: int) -> Camera:
        """The same view with no side longer than this many pixels; never enlarged."""
        factor = min(1.0, long_side / max(self.width, self.height))
        return self.scaled(max(1, round(self.width * factor)), max(1, round(self.height * factor)))

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Project world points with the pinhole, without distortion.

        Args:
            points: [n, 3], world.

        Returns:
            Pixels [n, 2], and depth [n] in world units, negative behind the camera.
        """
        world_to_camera = self.world_to_camera
        local = points @ world_to_camera[:3, :3].T + world_to_camera[:3, 3]
        depth = -local[:, 2]
        pixels = np.stack([self.cx + self.fx * local[:, 0] / depth, self.cy - self.fy * local[:, 1] / depth], -1)
        return pixels, depth

    def rays(self, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rays of the pinhole through pixel positions.

        Args:
            pixels: [n, 2].

        Returns:
            Origins [n, 3], and directions [n, 3] of unit depth, float64, world: a point at `depth` d lies at
            origin + d * direction. Divide by the norm for `viewdirs`.
        """
        local = np.stack(
            [
                (pixels[:, 0] - self.cx) / self.fx,
                (self.cy - pixels[:, 1]) / self.fy,
                -np.ones(len(pixels)),
            ],
            -1,
        )
        directions = local @ self.camera_to_world[:3, :3].T
        return np.broadcast_to(self.position, directions.shape), directions

    def pixel_centers(self) -> np.ndarray:
        """Centers of all pixels, row by row, [height * width, 2]."""
        v, u = np.mgrid[0 : self.height, 0 : self.width]
        return np.stack([u.ravel() + 0.5, v.ravel() + 0.5], -1)


def wrong_size(photo: Path, width: int, height: int, camera: Camera) -> DataError:
    """The error for a photo of this many pixels, which are not its camera's."""
    return DataError(
        "{path} is {width}x{height} pixels where its camera has {expected_width}x{expected_height}.",
        "Import the capture again.",
        path=photo,
        width=width,
        height=height,
        expected_width=camera.width,
        expected_height=camera.height,
    )
