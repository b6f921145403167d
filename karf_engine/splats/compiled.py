"""Rasterization and training of Gaussians by numba's kernels on the processor.

Results do not depend on the number of threads.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from ..compute.cores import parallel_for
from ..errors import OutOfMemory
from .gaussians import Gaussians
from .kernels.adam import adam
from .kernels.arrays import COLOR, ENTRY, LOG_SCALE, SPLAT, SPLAT_GRADIENTS, TILE, TILE_BOX, Pinhole
from .kernels.blending import blend, blend_back, blend_values, count_entries, fill_entries
from .kernels.projection import project, project_back
from .view import UNKNOWN_COLOR, RasterizedView

CHANNELS = ("red", "green", "blue")


class CompiledView(RasterizedView):
    """`RasterizedView` of numba's kernels."""

    offsets: np.ndarray  # [n + 1] int32, first tile entry of each Gaussian in the order of the table

    def __init__(
        self,
        table: np.ndarray,
        camera: Pinhole,
        background: tuple[float, float, float],
        confidence: np.ndarray | None = None,
    ) -> None:
        """Rasterize a table (see `Gaussians`). Raises OutOfMemory if too many cover too much of the picture.

        confidence: see `rasterizer.rasterize`.
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
        return np.diff(self.offsets) > 0

    @cached_property
    def colors(self) -> np.ndarray:
        return np.stack([np.where(self.is_seen, self._splats[name], np.float32(0)) for name in CHANNELS], 1)

    def blended(self, values: np.ndarray) -> np.ndarray:
        result = np.empty((values.shape[1], *self.image.shape[:2]), np.float32)
        parallel_for(blend_values, len(self._starts) - 1, *self._of_tiles, np.ascontiguousarray(values), result)
        return result

    def weights(self) -> np.ndarray:
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


class CompiledTable:
    """`TrainedTable` of numba's kernels."""

    def __init__(self, gaussians: Gaussians, least: np.ndarray) -> None:
        """See `rasterizer.trained_table`."""
        self._table, self._n_foreground, self._least = gaussians.table.copy(), gaussians.n_foreground, least
        self._gradients, self._means, self._squares = (np.zeros_like(self._table) for _ in range(3))
        self._steps = np.zeros(len(self._table), np.int32)
        self._sizes = np.exp(self._table[:, LOG_SCALE : LOG_SCALE + 3].max(1))

    def view(self, camera: Pinhole, background: tuple[float, float, float]) -> CompiledView:
        return CompiledView(self._table, camera, background)

    def update(self, view: RasterizedView, gradient: np.ndarray, rates: np.ndarray) -> None:
        assert isinstance(view, CompiledView)
        view.backward(gradient, self._gradients)
        behind = self._gradients[self._n_foreground :]
        behind[:, :COLOR] = 0
        behind[:, COLOR + 3 :] = 0
        parallel_for(
            adam, len(self._table), self._table, self._gradients, self._means, self._squares, self._steps,
            view.offsets, rates, self._sizes, self._least,
        )  # fmt: skip

    def replace_rows(self, rows: np.ndarray, values: np.ndarray) -> None:
        self._table[rows] = values
        for each in (self._means, self._squares, self._steps):
            each[rows] = 0
        self._sizes[rows] = np.exp(values[:, LOG_SCALE : LOG_SCALE + 3].max(1))

    def is_finite(self) -> bool:
        with np.errstate(all="ignore"):
            return bool(np.isfinite(self._table.sum()))

    def tensors(self) -> dict[str, Tensor]:
        arrays = {"table": self._table, "means": self._means, "squares": self._squares, "steps": self._steps}
        return {name: torch.from_numpy(each) for name, each in (arrays | {"sizes": self._sizes}).items()}
