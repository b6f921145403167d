"""Gaussians as a camera sees them, on the processor: the picture, other values blended alike, and gradients.

After Kerbl et al. 2023 ("3D Gaussian Splatting for Real-Time Radiance Field Rendering"), with the screen filter of
Mip-Splatting (Yu et al. 2024): a picture of another size than those that were learned from is neither thicker nor
thinner. The same bits come out on any number of threads.
"""

from __future__ import annotations

import numpy as np

from ..capture.camera import Camera
from ..compute.cores import share
from ..errors import OutOfMemory
from .gaussians import Gaussians
from .kernels.arrays import ENTRY, PIXEL_FILTER, SLOPES, SPLAT, TILE, TILES, Pinhole, ScreenFilter
from .kernels.blending import blend, blend_back, blend_values
from .kernels.projection import project, project_back
from .kernels.tiles import count_entries, fill_entries

Background = tuple[float, float, float]
UNSURE = np.float32(0.5)  # sRGB gray into which fades what is not known


class SplattedView:
    """One view of a table of Gaussians.

    Attributes:
        depths: [n] float32 of the centers along the optical axis, world units; of unseen ones anything.
        image: [H, W, 4] float32: sRGB over the background, and the transmittance.
        slots: [n + 1] int32, which Gaussians are seen: those of which the next number is larger.
    """

    def __init__(
        self, table: np.ndarray, camera: Pinhole, background: Background, sure: np.ndarray | None = None
    ) -> None:
        """Splat a table [n, 11 + 3 K] float32 (see `gaussians.Gaussians`).

        sure: [n] in [0, 1], as how sure Gaussians are drawn; None: all are, and not one bit is another.

        Raises OutOfMemory where too many Gaussians cover too much of the picture.
        """
        n, tiles_x = len(table), -(-camera.width // TILE)
        n_tiles = tiles_x * -(-camera.height // TILE)
        self._table, self._camera = table, camera
        self._splats, tiles = np.empty(n, SPLAT), np.empty(n, TILES)
        share(project, n, table, camera, self._splats, tiles)
        self.slots, self._starts = np.empty(n + 1, np.int32), np.zeros(n_tiles + 1, np.int32)
        if not count_entries(tiles, tiles_x, self.slots, self._starts):
            raise OutOfMemory(
                "Too many of {count} Gaussians cover too much of a picture of {width}x{height} pixels.",
                "Render smaller pictures, or remove the largest Gaussians in the program that wrote them.",
                count=n,
                width=camera.width,
                height=camera.height,
            )
        order = _near_to_far(self._splats["depth"], np.flatnonzero(np.diff(self.slots)))
        self._entries = np.empty(self.slots[-1], ENTRY)
        fill_entries(order, tiles, tiles_x, self.slots, self._starts[:-1].copy(), self._entries)
        self._colors = None
        if sure is not None:
            self._colors = self.colors
            _fade(self._splats, sure, np.flatnonzero((sure < 1) & (np.diff(self.slots) > 0)))
        self.image = np.empty((camera.height, camera.width, 4), np.float32)
        share(blend, n_tiles, *self._of_tiles, np.asarray(background, np.float32), self.image)
        self.depths = self._splats["depth"]

    @property
    def _of_tiles(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self._splats, self._entries, self._starts

    @property
    def colors(self) -> np.ndarray:
        """Colors of the Gaussians as seen from here, [n, 3] float32 sRGB, at least 0; of unseen ones 0. None is faded."""
        if self._colors is not None:
            return self._colors
        is_seen = np.diff(self.slots) > 0
        return np.stack([np.where(is_seen, self._splats[name], np.float32(0)) for name in ("red", "green", "blue")], 1)

    def picture(self) -> np.ndarray:
        """What a screen shows of the image, whose own values are clipped with it: [H, W, 3] float32 sRGB in [0, 1]."""
        return np.clip(self.image, 0, 1, out=self.image)[..., :3]

    def blended(self, values: np.ndarray) -> np.ndarray:
        """Other values of the Gaussians, [n, C] float32, blended as their colors are, over 0: [C, H, W] float32."""
        result = np.empty((values.shape[1], *self.image.shape[:2]), np.float32)
        share(blend_values, len(self._starts) - 1, *self._of_tiles, np.ascontiguousarray(values), result)
        return result

    def weights(self) -> np.ndarray:
        """What each Gaussian is blended with, [n] float32 >= 0: the sum over all pixels."""
        slopes = np.empty(len(self._entries), SLOPES)
        share(blend_back, len(self._starts) - 1, *self._of_tiles, self.image, np.ones_like(self.image[..., :3]), slopes)
        seen, result = np.flatnonzero(np.diff(self.slots)), np.zeros(len(self._table), np.float32)
        if len(seen):
            result[seen] = np.add.reduceat(slopes["red"], self.slots[seen])  # the slope of the picture by its color
        return result

    def backward(self, gradient: np.ndarray, gradients: np.ndarray) -> None:
        """Write the gradients of a loss to the rows that are seen; others are left as they are.

        Args:
            gradient: [H, W, 3] float32, to the image's colors.
            gradients: [n, 11 + 3 K] float32.
        """
        slopes = np.empty(len(self._entries), SLOPES)
        share(blend_back, len(self._starts) - 1, *self._of_tiles, self.image, gradient, slopes)
        share(project_back, len(self._table), self._table, self._camera, self._splats, self.slots, slopes, gradients)


def _fade(splats: np.ndarray, sure: np.ndarray, rows: np.ndarray) -> None:
    """Turn the colors of these rows gray as far as they are not sure."""
    share_of_gray = (1 - sure[rows]) * UNSURE
    for name in ("red", "green", "blue"):
        splats[name][rows] = splats[name][rows] * sure[rows] + share_of_gray


def _near_to_far(depths: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """The seen Gaussians in the order of their depths, which as positive floats sort like whole numbers."""
    return seen[np.argsort(depths[seen].view(np.int32), kind="stable")].astype(np.int32)


def pinhole(camera: Camera, near: float, screen_filter: ScreenFilter = PIXEL_FILTER) -> Pinhole:
    """A camera as kernels read it; its lens distortion is left out. near, screen_filter: see `Gaussians`."""
    world_to_camera = np.diag([1.0, -1, -1, 1]) @ np.linalg.inv(camera.camera_to_world)
    turn, shift = world_to_camera[:3, :3].ravel(), world_to_camera[:3, 3]
    numbers = map(np.float32, (camera.fx, camera.fy, camera.cx, camera.cy))
    eye = camera.camera_to_world[:3, 3]
    arrays = (np.ascontiguousarray(each, np.float32) for each in (turn, shift, eye))
    return Pinhole(*arrays, *numbers, camera.width, camera.height, np.float32(near), *screen_filter)


def splatted(gaussians: Gaussians, camera: Camera, sure: np.ndarray | None = None) -> SplattedView:
    """Gaussians as a camera's pinhole sees them. sure: see `SplattedView`."""
    seen_by = pinhole(camera, gaussians.near, gaussians.screen_filter)
    return SplattedView(gaussians.table, seen_by, gaussians.background, sure)
