"""Rays of camera pixels, the encoding of their directions, and the dataset of all training pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ...capture.camera import Camera
from ...capture.distortion import undistort_points
from ...compute.runtime import Runtime
from ...io.color import to_bytes


@dataclass(frozen=True)
class Rays:
    """Rays on one device, float32. Indexing selects some of them."""

    origins: Tensor  # [R, 3], world units
    viewdirs: Tensor  # [R, 3], unit directions

    def __len__(self) -> int:
        return len(self.origins)

    def __getitem__(self, index) -> Rays:
        return Rays(self.origins[index], self.viewdirs[index])


def camera_rays(camera: Camera, device: torch.device | str = "cpu") -> Rays:
    """Return the rays through all pixel centers of a camera, row by row from the top left, with its lens distortion.

    Pixels outside the valid area of the lens get the ray of the principal point.
    """
    origins, directions = _unit_depth_rays(camera)
    viewdirs = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return Rays(_tensor(origins, device), _tensor(viewdirs, device))


def depth_per_distance(camera: Camera) -> np.ndarray:
    """Return the depth along the optical axis per distance along each pixel's ray, [height * width] float64."""
    _, directions = _unit_depth_rays(camera)
    return 1.0 / np.linalg.norm(directions, axis=1)


def _unit_depth_rays(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    pixels = undistort_points(camera, camera.pixel_centers())
    return camera.rays(np.where(np.isnan(pixels), (camera.cx, camera.cy), pixels))


def _tensor(array: np.ndarray, device: torch.device | str) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(array, np.float32)).to(device)


def spherical_harmonics(viewdirs: Tensor) -> Tensor:
    """Evaluate the real spherical harmonics of degrees 0 to 2, [n, 9], of unit directions [n, 3] (Sloan 2008)."""
    x, y, z = viewdirs.unbind(1)
    return torch.stack(
        [
            torch.full_like(x, 0.282095),
            0.488603 * y,
            0.488603 * z,
            0.488603 * x,
            1.092548 * x * y,
            1.092548 * y * z,
            0.315392 * (3 * z * z - 1),
            1.092548 * x * z,
            0.546274 * (x * x - y * y),
        ],
        1,
    )


class PixelDataset:
    """All N pixels of V training images with their rays, addressed by one flat index."""

    def __init__(
        self,
        cameras: list[Camera],
        colors: list[np.ndarray],
        alphas: list[np.ndarray] | None,
        solids: list[np.ndarray] | None = None,
        valid: list[np.ndarray] | None = None,
        device: torch.device | str = "cpu",
    ) -> None:
        """Concatenate the pixels of V images [H, W, 3] in [0, 1], mattes [H, W] in [0, 1] and masks [H, W] bool.

        `solids` are pixels known to be opaque; `draw` returns only pixels of `valid`, or all for None.
        """

        def concatenate(images: list[np.ndarray], *channels: int) -> Tensor:
            return torch.from_numpy(np.concatenate([image.reshape(-1, *channels) for image in images])).to(device)

        self.cameras = cameras
        self.color = concatenate([to_bytes(color) for color in colors], 3)  # [N, 3] uint8 sRGB
        self.alpha = None if alphas is None else concatenate([to_bytes(alpha) for alpha in alphas])  # [N] uint8
        self.solid = None if solids is None else concatenate(solids)  # [N] bool
        self.gains = torch.ones(len(cameras), 3, device=device)  # exposures of the images; 1 until they are estimated
        self._usable = None if valid is None else torch.nonzero(concatenate(valid)).squeeze(1)
        sizes = torch.tensor([c.width * c.height for c in cameras])
        # image v has the pixels offsets[v] .. offsets[v + 1] - 1
        self.offsets = torch.cat([torch.zeros(1, dtype=torch.long), sizes.cumsum(0)]).to(device)
        self._widths = torch.tensor([c.width for c in cameras], device=device)
        self._intrinsics = torch.tensor([[c.fx, c.fy, c.cx, c.cy] for c in cameras], dtype=torch.float32, device=device)
        self._rotations = _tensor(np.stack([c.camera_to_world[:3, :3] for c in cameras]), device)
        self._positions = _tensor(np.stack([c.position for c in cameras]), device)

    def __len__(self) -> int:
        return len(self.color)

    def draw(self, count: int, runtime: Runtime) -> Tensor:
        """Draw the indices of `count` random valid pixels."""
        if self._usable is None:
            return runtime.randint(len(self), count)
        return self._usable[runtime.randint(len(self._usable), count)]

    def draw_central(self, count: int, share: float, runtime: Runtime) -> Tensor:
        """Draw the indices of `count` random pixels from the central `share` of each side of random images."""
        view = runtime.randint(len(self.cameras), count)
        size = torch.stack([self._widths, torch.diff(self.offsets) // self._widths], 1)[view]
        pixels = ((0.5 + share * (runtime.rand(count, 2) - 0.5)) * size).long()
        return self.offsets[view] + pixels[:, 1] * size[:, 0] + pixels[:, 0]

    def view_indices(self, index: Tensor) -> Tensor:
        """Return the number of the training image of each pixel."""
        return torch.bucketize(index, self.offsets, right=True) - 1

    def image(self, number: int) -> np.ndarray:
        """Return a training image as photographed, [H, W, 3] float32 sRGB in [0, 1]."""
        camera, pixels = self.cameras[number], self.color[self.offsets[number] : self.offsets[number + 1]]
        return pixels.cpu().numpy().reshape(camera.height, camera.width, 3) / np.float32(255)

    def normalized_colors(self, index: Tensor) -> Tensor:
        """Return the sRGB colors [n, 3] of pixels at the mean exposure of all photos."""
        return self.color[index].float() / 255 / self.gains[self.view_indices(index)]

    def rays(self, index: Tensor) -> Rays:
        """Return the rays through the centers of these pixels."""
        view = self.view_indices(index)
        pixel = index - self.offsets[view]
        u = (pixel % self._widths[view]).float() + 0.5
        v = torch.div(pixel, self._widths[view], rounding_mode="floor").float() + 0.5
        fx, fy, cx, cy = self._intrinsics[view].unbind(1)
        local = torch.stack([(u - cx) / fx, (cy - v) / fy, -torch.ones_like(u)], 1)
        directions = torch.einsum("rij,rj->ri", self._rotations[view], local)
        return Rays(self._positions[view], torch.nn.functional.normalize(directions, dim=1))
