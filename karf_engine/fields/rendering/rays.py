"""Pixels of a capture as rays: `PixelDataset` holds every training pixel and hands out rays for any of them.

origins [R, 3] in world units; viewdirs [R, 3] of unit length, so that a sample's `distance` is its t.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ...capture.camera import Camera
from ...capture.distortion import straighten
from ...compute.runtime import Runtime
from ...io.color import to_bytes


@dataclass(frozen=True)
class Rays:
    """Rays, float32, on one device; indexing takes some of them.

    Attributes:
        origins: [R, 3], world units.
        viewdirs: [R, 3], of unit length.
    """

    origins: Tensor
    viewdirs: Tensor

    def __len__(self) -> int:
        return len(self.origins)

    def __getitem__(self, index) -> Rays:
        return Rays(self.origins[index], self.viewdirs[index])


def camera_rays(camera: Camera, device: torch.device | str = "cpu") -> Rays:
    """Rays through all pixel centers of a camera.

    Args:
        camera: With a lens distortion they are the rays of the photo as stored; where its lens shows nothing, the ray
            is that of the principal point.
        device: Where the rays' tensors live.

    Returns:
        width * height rays, row by row from the top left.

    Example:
        >>> rays = camera_rays(Camera(1, 1, 2.0, 2.0, 0.5, 0.5, np.eye(4)))
        >>> rays.viewdirs.tolist()  # cameras look down -z
        [[0.0, 0.0, -1.0]]
    """
    origins, directions = _unit_depth_rays(camera)
    viewdirs = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return Rays(_tensor(origins, device), _tensor(viewdirs, device))


def depth_per_distance(camera: Camera) -> np.ndarray:
    """Factor from distance along the ray to depth along the optical axis, for all pixels.

    Args:
        camera: As for `camera_rays`.

    Returns:
        Factors [height * width] in (0, 1], float64, row by row from the top left.

    Example:
        >>> depth_per_distance(Camera(1, 1, 1.0, 1.0, 0.5, 0.5, np.eye(4))).tolist()
        [1.0]
    """
    _, directions = _unit_depth_rays(camera)
    return 1.0 / np.linalg.norm(directions, axis=1)


def _unit_depth_rays(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    pixels = straighten(camera, camera.pixel_centers())
    return camera.rays(np.where(np.isnan(pixels), (camera.cx, camera.cy), pixels))


def _tensor(array: np.ndarray, device: torch.device | str) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(array, np.float32)).to(device)


class PixelDataset:
    """All pixels of some training images: their colors, mattes and rays, addressed by one running index.

    Attributes:
        cameras: Of the training images.
        color: [N, 3] uint8 sRGB.
        alpha: Mattes [N] uint8, or None.
        solid: [N] bool, pixels known to show something opaque, or None.
        gains: [V, 3] float32, how each training image is exposed beside the others, see `fields.exposures`; 1 until it is known.
        first: [V + 1]; the pixels of training image v are first[v] .. first[v + 1] - 1.

    Example:
        >>> camera = Camera(2, 1, 2.0, 2.0, 1.0, 0.5, np.eye(4))
        >>> dataset = PixelDataset([camera], [np.array([[[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]])], None)
        >>> dataset.color.tolist(), len(dataset.rays(torch.tensor([1])))
        ([[255, 0, 0], [0, 0, 255]], 1)
    """

    def __init__(
        self,
        cameras: list[Camera],
        colors: list[np.ndarray],
        alphas: list[np.ndarray] | None,
        solids: list[np.ndarray] | None = None,
        valid: list[np.ndarray] | None = None,
        device: torch.device | str = "cpu",
    ) -> None:
        """Gather the training images' pixels.

        Args:
            cameras: One a training image.
            colors: [H, W, 3] in [0, 1], one a training image.
            alphas: Mattes [H, W] in [0, 1], one a training image; or None.
            solids: [H, W] bool, one a training image; or None.
            valid: [H, W] bool, the pixels that `draw` may hand out, one a training image; None for all.
            device: Where the pixels are kept.
        """
        self.cameras = cameras
        self.color = torch.from_numpy(np.concatenate([to_bytes(c).reshape(-1, 3) for c in colors])).to(device)
        self.gains = torch.ones(len(cameras), 3, device=device)
        self.alpha = (
            None
            if alphas is None
            else torch.from_numpy(np.concatenate([to_bytes(a).ravel() for a in alphas])).to(device)
        )
        self.solid = (
            None if solids is None else torch.from_numpy(np.concatenate([s.ravel() for s in solids])).to(device)
        )
        self._usable = None
        if valid is not None:
            self._usable = torch.from_numpy(np.flatnonzero(np.concatenate([v.ravel() for v in valid]))).to(device)
        sizes = torch.tensor([c.width * c.height for c in cameras])
        self.first = torch.cat([torch.zeros(1, dtype=torch.long), sizes.cumsum(0)]).to(device)
        self._widths = torch.tensor([c.width for c in cameras], device=device)
        self._intrinsics = torch.tensor([[c.fx, c.fy, c.cx, c.cy] for c in cameras], dtype=torch.float32, device=device)
        self._rotations = _tensor(np.stack([c.camera_to_world[:3, :3] for c in cameras]), device)
        self._positions = _tensor(np.stack([c.position for c in cameras]), device)

    def __len__(self) -> int:
        return len(self.color)

    def draw(self, count: int, runtime: Runtime) -> Tensor:
        """Running indices of `count` random usable pixels."""
        if self._usable is None:
            return runtime.randint(len(self), count)
        return self._usable[runtime.randint(len(self._usable), count)]

    def draw_central(self, count: int, share: float, runtime: Runtime) -> Tensor:
        """Running indices of `count` random pixels of the middle `share` of a random picture's width and height."""
        view = runtime.randint(len(self.cameras), count)
        size = torch.stack([self._widths, torch.diff(self.first) // self._widths], 1)[view]
        pixels = ((0.5 + share * (runtime.rand(count, 2) - 0.5)) * size).long()
        return self.first[view] + pixels[:, 1] * size[:, 0] + pixels[:, 0]

    def view_of(self, index: Tensor) -> Tensor:
        """Which training image each running index belongs to."""
        return torch.bucketize(index, self.first, right=True) - 1

    def picture(self, number: int) -> np.ndarray:
        """The training image with this number as it was photographed, [H, W, 3] float32 sRGB in [0, 1]."""
        camera, pixels = self.cameras[number], self.color[self.first[number] : self.first[number + 1]]
        return pixels.cpu().numpy().reshape(camera.height, camera.width, 3) / np.float32(255)

    def exposed_alike(self, index: Tensor) -> Tensor:
        """Colors of the pixels with these running indices in the exposure that photos have in the mean, float sRGB [n, 3]."""
        return self.color[index].float() / 255 / self.gains[self.view_of(index)]

    def rays(self, index: Tensor) -> Rays:
        """Rays through the centers of the pixels with these running indices."""
        view = self.view_of(index)
        pixel = index - self.first[view]
        u = (pixel % self._widths[view]).float() + 0.5
        v = torch.div(pixel, self._widths[view], rounding_mode="floor").float() + 0.5
        fx, fy, cx, cy = self._intrinsics[view].unbind(1)
        local = torch.stack([(u - cx) / fx, (cy - v) / fy, -torch.ones_like(u)], 1)
        directions = torch.einsum("rij,rj->ri", self._rotations[view], local)
        return Rays(self._positions[view], torch.nn.functional.normalize(directions, dim=1))
