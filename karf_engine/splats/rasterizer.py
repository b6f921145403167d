"""Rasterization of Gaussians on the processor: images, blending of other values, and gradients.

After Kerbl et al. 2023 ("3D Gaussian Splatting for Real-Time Radiance Field Rendering"), with the screen filter of
Mip-Splatting (Yu et al. 2024). Results do not depend on the number of threads.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..capture.camera import Camera
from ..compute.cores import parallel_for
from ..errors import OutOfMemory
from .gaussians import Gaussians
from .kernels.arrays import ENTRY, PIXEL_FILTER, SPLAT, SPLAT_GRADIENTS, TILE, TILE_BOX, Pinhole, ScreenFilter
from .kernels.blending import blend, blend_back, blend_values, count_entries, fill_entries
from .kernels.projection import project, project_back

CHANNELS = ("red", "green", "blue")
UNKNOWN_COLOR = np.float32(0.5)  # sRGB gray of Gaussians with confidence 0


class RasterizedView:
    """One view of a table of Gaussians."""

    depths: np.ndarray  # [n] float32, of the centers, world units; undefined for invisible Gaussians
    image: np.ndarray  # [H, W, 4] float32, sRGB over the background, and the transmittance
    offsets: np.ndarray  # [n + 1] int32, first tile entry of each Gaussian in the order of the table

    def __init__(
        self,
        table: np.ndarray,
        camera: Pinhole,
        background: tuple[float, float, float],
        confidence: np.ndarray | None = None,
    ) -> None:
        """Rasterize a table (see `Gaussians`). Raises OutOfMemory if too many cover too much of the picture.

        confidence: [n] in [0, 1], fades colors to UNKNOWN_COLOR; None is the same as all 1, to the bit.
        """
        n, tiles_x = len(table), -(-camera.width // TILE)
        n_tiles = tiles_x * -(-camera.height // TILE)
        self._table, self._camera = table, camera
        self._splats, boxes = np.empty(n, SPLAT), np.empty(n, TILE_BOX)
        parallel_for(project, n, table, camera, self._splats, boxes)
        self.offsets, self._starts = np.empty(n + 1, np.int32), np.zeros(n_tiles + 1, np.int32)
        if not count_entries(boxes, tiles_x, self.offsets, self._starts):
            raise OutOfMemory(
                "Too many of {count} Gaussians cover too much of a picture of {width}x{height} pixels.",
                "Render smaller pictures, or remove the largest Gaussians in the program that wrote them.",
                count=n,
                width=camera.width,
                height=camera.height,
            )
        self.depths, seen = self._splats["depth"], np.flatnonzero(self.is_seen)
        # positive floats sort like integers
        order = seen[np.argsort(self.depths[seen].view(np.int32), kind="stable")].astype(np.int32)
        self._entries = np.empty(self.offsets[-1], ENTRY)
        fill_entries(order, boxes, tiles_x, self.offsets, self._starts[:-1].copy(), self._entries)
        if confidence is not None:
            _ = self.colors  # caches them before fading
            faded = np.flatnonzero((confidence < 1) & self.is_seen)
            gray = (1 - confidence[faded]) * UNKNOWN_COLOR
            for name in CHANNELS:
                self._splats[name][faded] = self._splats[name][faded] * confidence[faded] + gray
        self.image = np.empty((camera.height, camera.width, 4), np.float32)
        parallel_for(blend, n_tiles, *self._of_tiles, np.asarray(background, np.float32), self.image)

    @property
    def _of_tiles(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self._splats, self._entries, self._starts

    @property
    def is_seen(self) -> np.ndarray:
        """Gaussians that cover part of the picture, [n] bool."""
        return np.diff(self.offsets) > 0

    @cached_property
    def colors(self) -> np.ndarray:
        """Colors of the Gaussians from this viewpoint before fading, [n, 3] float32 sRGB >= 0; 0 if not seen."""
        return np.stack([np.where(self.is_seen, self._splats[name], np.float32(0)) for name in CHANNELS], 1)

    def picture(self) -> np.ndarray:
        """Clip the image in place to [0, 1]; return its colors [H, W, 3]."""
        return np.clip(self.image, 0, 1, out=self.image)[..., :3]

    def blended(self, values: np.ndarray) -> np.ndarray:
        """Blend values [n, C] of the Gaussians like their colors, over 0; return [C, H, W] float32."""
        result = np.empty((values.shape[1], *self.image.shape[:2]), np.float32)
        parallel_for(blend_values, len(self._starts) - 1, *self._of_tiles, np.ascontiguousarray(values), result)
        return result

    def weights(self) -> np.ndarray:
        """Return the sum of each Gaussian's blending weights over all pixels, [n] float32 >= 0."""
        seen, result = np.flatnonzero(self.is_seen), np.zeros(len(self._table), np.float32)
        gradients = self._splat_gradients(np.ones_like(self.image[..., :3]))
        if len(seen):
            result[seen] = np.add.reduceat(gradients["red"], self.offsets[seen])  # derivatives of the red channel's sum
        return result

    def backward(self, gradient: np.ndarray, gradients: np.ndarray) -> None:
        """Write the `gradients` [n, 11 + 3 K] of visible rows from that of the image's colors, [H, W, 3] float32."""
        by_splat = self._splat_gradients(gradient)
        parallel_for(
            project_back, len(self._table), self._table, self._camera, self._splats, self.offsets, by_splat, gradients
        )

    def _splat_gradients(self, gradient: np.ndarray) -> np.ndarray:
        """Return the gradients of each Gaussian in each tile, SPLAT_GRADIENTS."""
        result = np.empty(len(self._entries), SPLAT_GRADIENTS)
        parallel_for(blend_back, len(self._starts) - 1, *self._of_tiles, self.image, gradient, result)
        return result


def pinhole(camera: Camera, near: float, screen_filter: ScreenFilter = PIXEL_FILTER) -> Pinhole:
    """Return a camera for the kernels; lens distortion is ignored. near, screen_filter: see `Gaussians`."""
    world_to_camera = np.diag([1.0, -1, -1, 1]) @ np.linalg.inv(camera.camera_to_world)
    rotation, translation = world_to_camera[:3, :3].ravel(), world_to_camera[:3, 3]
    eye = camera.camera_to_world[:3, 3]
    rotation, translation, eye = (np.ascontiguousarray(each, np.float32) for each in (rotation, translation, eye))
    fx, fy, cx, cy = (np.float32(value) for value in (camera.fx, camera.fy, camera.cx, camera.cy))
    size = camera.width, camera.height
    return Pinhole(rotation, translation, eye, fx, fy, cx, cy, *size, np.float32(near), *screen_filter)


def rasterize(gaussians: Gaussians, camera: Camera, confidence: np.ndarray | None = None) -> RasterizedView:
    """Rasterize Gaussians for a camera without its lens distortion. confidence: see `RasterizedView`."""
    shown_by = pinhole(camera, gaussians.near, gaussians.screen_filter)
    return RasterizedView(gaussians.table, shown_by, gaussians.background, confidence)
