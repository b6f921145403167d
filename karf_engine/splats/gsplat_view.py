"""Rasterization and training of Gaussians by gsplat's kernels on a CUDA card (Ye et al. 2024, "gsplat").

It follows `compiled` but for three of gsplat's constants: alpha is clamped at 0.999, not at 0.99; a pixel is finished
before its transmittance falls to 1e-4, not a tile after all of its pixels have; and sums are in another order each time,
so that results are equal to rounding, not to the bit.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
import torch
from gsplat import (  # pyright: ignore[reportMissingImports]
    fully_fused_projection,
    isect_offset_encode,
    isect_tiles,
    rasterize_to_pixels,
    spherical_harmonics,
)
from torch import Tensor

from .gaussians import DEGREES, Gaussians
from .kernels.arrays import BORDER, CENTER, COLOR, LOG_SCALE, LOGIT, MIN_ALPHA, ROTATION, TILE, Pinhole
from .view import UNKNOWN_COLOR, RasterizedView

CHANNELS_AT_ONCE = 32  # that fit into a block's shared memory
RADIUS = 3.33  # gsplat's radii, standard deviations
FAR = 3e38
BETA1, BETA2, EPSILON = 0.9, 0.99, 1e-15  # of Adam, see kernels/adam.py


class GsplatView(RasterizedView):
    """`RasterizedView` of gsplat. Differentiable in a table that requires gradients."""

    def __init__(
        self,
        table: Tensor,
        camera: Pinhole,
        background: tuple[float, float, float],
        confidence: np.ndarray | None = None,
    ) -> None:
        """Rasterize a table on a card (see `Gaussians`). confidence: see `rasterizer.rasterize`."""
        self._size, device = (camera.width, camera.height), table.device
        with torch.set_grad_enabled(table.requires_grad):
            self._project(table, camera)
            self._colors = colors = _seen_colors(table, camera)
            if confidence is not None:
                sure = torch.from_numpy(confidence).to(colors)[:, None]
                colors = colors * sure + (1 - sure) * float(UNKNOWN_COLOR)
            behind = torch.tensor([background], dtype=torch.float32, device=device)
            self.rendered, opacity = self._blend(colors, behind)  # [1, H, W, 3]
        self.image = torch.cat([self.rendered, 1 - opacity], -1)[0].detach().cpu().numpy()

    def _project(self, table: Tensor, camera: Pinhole) -> None:
        # gsplat bends shapes whose center is farther from the picture than 0.15 of its side, so it gets a larger picture
        border = BORDER * max(self._size)
        margin = math.ceil(border)
        width, height = self._size
        pose = np.eye(4, dtype=np.float32)
        pose[:3, :3], pose[:3, 3] = camera.rotation.reshape(3, 3), camera.translation
        rows = [[camera.fx, 0, camera.cx + margin], [0, camera.fy, camera.cy + margin], [0, 0, 1]]
        lens = np.array(rows, np.float32)
        pose, lens = (torch.from_numpy(each)[None].to(table.device) for each in (pose, lens))
        radii, means, depths, self._conics, shares = fully_fused_projection(
            table[:, CENTER:LOG_SCALE].contiguous(), None, table[:, ROTATION:LOGIT].contiguous(),
            table[:, LOG_SCALE:ROTATION].exp(), pose, lens, width + 2 * margin, height + 2 * margin,
            eps2d=float(camera.blur), near_plane=float(camera.near), far_plane=FAR, calc_compensations=True,
        )  # fmt: skip
        self._means = means - margin
        is_valid = (radii > 0).all(-1) & self._conics.isfinite().all(-1)  # else gsplat leaves the rest undefined
        shares = torch.where(is_valid, shares.clamp_min(math.sqrt(float(camera.least_share))), 0)
        self._opacities = torch.sigmoid(table[:, LOGIT]) * shares
        with torch.no_grad():
            limits = torch.tensor([width, height], dtype=torch.float32, device=table.device)
            reach = radii * ((2 * (self._opacities / float(MIN_ALPHA)).log()).sqrt() / RADIUS)[..., None]
            is_inside = (self._means >= -border) & (self._means <= limits + border)
            touches = (self._means + reach > 0) & (self._means - reach < limits)
            seen = is_valid & (self._opacities >= float(MIN_ALPHA)) & (is_inside & touches).all(-1)
            radii = torch.where(seen[..., None], reach, 0).ceil().int()
            tiles_x, tiles_y = -(-width // TILE), -(-height // TILE)
            _, tiles, self._order = isect_tiles(self._means, radii, depths, TILE, tiles_x, tiles_y)
            self._starts = isect_offset_encode(tiles, 1, tiles_x, tiles_y)
        self.seen, self._depths = seen[0], depths[0].detach()

    def _blend(self, values: Tensor, background: Tensor | None = None) -> tuple[Tensor, Tensor]:
        return rasterize_to_pixels(
            self._means, self._conics, values[None], self._opacities, *self._size, TILE, self._starts, self._order,
            backgrounds=background,
        )  # fmt: skip

    @cached_property
    def is_seen(self) -> np.ndarray:
        return self.seen.cpu().numpy()

    @cached_property
    def depths(self) -> np.ndarray:
        return self._depths.cpu().numpy()

    @cached_property
    def colors(self) -> np.ndarray:
        return torch.where(self.seen[:, None], self._colors.detach(), 0).cpu().numpy()

    @torch.no_grad()
    def blended(self, values: np.ndarray) -> np.ndarray:
        parts = torch.from_numpy(np.asarray(values, np.float32)).to(self.seen.device).split(CHANNELS_AT_ONCE, 1)
        return torch.cat([self._blend(part)[0][0] for part in parts], -1).permute(2, 0, 1).contiguous().cpu().numpy()

    def weights(self) -> np.ndarray:
        ones = torch.ones(len(self.seen), 1, device=self.seen.device, requires_grad=True)
        with torch.enable_grad():
            total = self._blend(ones)[0].sum()
        return torch.autograd.grad(total, ones)[0][:, 0].cpu().numpy()


def _seen_colors(table: Tensor, camera: Pinhole) -> Tensor:
    """Return max(0, 0.5 + sum of harmonics), [n, 3]."""
    directions = table[:, CENTER:LOG_SCALE] - torch.from_numpy(camera.eye).to(table.device)
    harmonics = table[:, COLOR:].reshape(len(table), -1, 3)
    return (0.5 + spherical_harmonics(DEGREES[harmonics.shape[1]], directions, harmonics)).clamp_min(0)


class GsplatTable:
    """`TrainedTable` of gsplat."""

    def __init__(self, gaussians: Gaussians, least: np.ndarray, device: torch.device) -> None:
        """See `rasterizer.trained_table`."""
        self._table = torch.from_numpy(gaussians.table.copy()).to(device).requires_grad_()
        self._n_foreground, self._least = gaussians.n_foreground, torch.from_numpy(least).to(device)[:, None]
        self._means, self._squares = torch.zeros_like(self._table), torch.zeros_like(self._table)
        self._steps = torch.zeros(len(gaussians), dtype=torch.int32, device=device)
        self._sizes = self._table.detach()[:, LOG_SCALE:ROTATION].amax(1).exp()

    def view(self, camera: Pinhole, background: tuple[float, float, float]) -> GsplatView:
        return GsplatView(self._table, camera, background)

    def update(self, view: RasterizedView, gradient: np.ndarray, rates: np.ndarray) -> None:
        assert isinstance(view, GsplatView)
        given = torch.from_numpy(np.asarray(gradient, np.float32)).to(self._table)[None]
        (by_table,) = torch.autograd.grad(view.rendered, self._table, given)
        behind = by_table[self._n_foreground :]
        behind[:, :COLOR] = 0
        behind[:, COLOR + 3 :] = 0
        with torch.no_grad():
            self._adam(view.seen[:, None], by_table, torch.from_numpy(rates).to(self._table))

    def _adam(self, seen: Tensor, gradient: Tensor, rates: Tensor) -> None:
        """See kernels/adam.py; without a branch that would wait for the card."""
        self._steps += seen[:, 0]
        count = self._steps.clamp_min(1)[:, None].float()
        means = BETA1 * self._means + (1 - BETA1) * gradient
        squares = BETA2 * self._squares + (1 - BETA2) * gradient * gradient
        correction, root = 1 / (1 - BETA1**count), (1 - BETA2**count).rsqrt()
        step = rates * correction * means / (squares.sqrt() * root + EPSILON)
        step[:, :LOG_SCALE] *= self._sizes[:, None]
        table = self._table - step
        table[:, LOG_SCALE:ROTATION] = table[:, LOG_SCALE:ROTATION].maximum(self._least)
        for kept, new in ((self._table, table), (self._means, means), (self._squares, squares)):
            kept.copy_(torch.where(seen, new, kept))

    def replace_rows(self, rows: np.ndarray, values: np.ndarray) -> None:
        index, new = torch.from_numpy(rows).to(self._table.device), torch.from_numpy(values).to(self._table)
        for kept, value in zip(self.tensors().values(), (new, 0, 0, 0), strict=False):
            kept[index] = value
        self._sizes[index] = new[:, LOG_SCALE:ROTATION].amax(1).exp()

    def is_finite(self) -> bool:
        return bool(self._table.detach().sum().isfinite())

    def tensors(self) -> dict[str, Tensor]:
        return {
            "table": self._table.detach(), "means": self._means, "squares": self._squares, "steps": self._steps,
            "sizes": self._sizes,
        }  # fmt: skip
