"""Fitting a NeRF to photos as the original implementation does: random rays, a coarse and a fine pass, Adam.

The background is a constant color: white behind mattes and white backgrounds, else black.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch
from torch import Tensor

from ...compute.progress import Progress
from ...compute.runtime import Runtime
from ...project.settings import NerfSettings
from ..fit import Checkpoint
from ..rendering.rays import PixelDataset, Rays
from ..rendering.sampling import dense_ray_weights, interval_lengths, refine
from ..rendering.surface_cache import cache_surface
from ..scene import Scene
from ..training import (
    Adam,
    Metrics,
    TrainingState,
    add_prefix,
    check_same_layout,
    read_integer,
    scalar_tensor,
    strip_prefix,
    train,
)
from .field import NerfField, NerfNetwork, points_along

CROP_SHARE = 0.5  # central share of the image sides where the first rays are drawn, to see the object early
MEASURED_RAYS = 2048
STRAYS = 0.005  # quantile of surface positions outside the bounds, on each side
BOUNDS_MARGIN = 0.05


@contextmanager
def tf32_matmul(device: torch.device) -> Iterator[None]:
    """Use TF32 matrix products on CUDA. Only for training: the high frequencies of positions lose digits."""
    before = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision("high" if device.type == "cuda" else before)
    try:
        yield
    finally:
        torch.set_float32_matmul_precision(before)


class NerfFit:
    """A `Fit` of a NeRF (see fields/fit.py)."""

    def __init__(
        self, dataset: PixelDataset, kind: str, settings: NerfSettings, runtime: Runtime, field: NerfField
    ) -> None:
        self.dataset, self.background_kind, self.settings = dataset, kind, settings
        self.runtime, self.field = runtime, field
        self._white = kind in ("alpha", "white")
        self._noise = settings.density_noise if field.space.is_forward_facing else 0.0
        self._crop = 0 if kind == "opaque" else settings.crop_iterations
        self._loss_average = scalar_tensor(0.1).to(runtime.device)  # reading it would wait for the device
        self._yielded = 0  # iterations of the last yielded scene
        optimizer = Adam(field.parameters(), lr=settings.rate)
        self._training_state = TrainingState(settings.iterations, optimizer, field.state_dict, runtime)

    @property
    def iterations(self) -> int:
        """Iterations of the whole fit."""
        return self.settings.iterations

    @property
    def done(self) -> int:
        """Iterations done."""
        return self._training_state.done

    def scenes(self, progress: Progress, checkpoint: Checkpoint | None = None) -> Iterator[Scene]:
        """Run the rest of the fit; yield the scene every `look_every` iterations and at the end."""
        field = self.field
        while self._yielded < self.iterations:
            until = min(self._yielded + self.settings.look_every, self.iterations)
            with tf32_matmul(self.runtime.device):
                train(self._training_state, until, self._step, self._decay, progress, checkpoint)
            field.bounds = surface_bounds(field, self.dataset.rays(self.dataset.draw(MEASURED_RAYS, self.runtime)))
            self._yielded = until
            yield Scene(field, None, self.background_kind, 1.0)

    def state(self) -> dict[str, Tensor]:
        """Return all tensors needed to resume."""
        return self._counters() | add_prefix("course", self._training_state.state())

    def resume(self, state: dict[str, Tensor]) -> None:
        """Resume a state on the CPU (see `Resumable.resume`)."""
        check_same_layout({n: t for n, t in state.items() if not n.startswith("course.")}, self._counters())
        yielded = read_integer(state, "looked", self.iterations - 1)
        self._training_state.resume(strip_prefix("course", state))
        self._yielded = yielded
        self._loss_average.copy_(state["loss_average"])

    def _counters(self) -> dict[str, Tensor]:
        return {"looked": scalar_tensor(self._yielded), "loss_average": self._loss_average}

    def _decay(self, iteration: int, _: int) -> float:
        steps = self.settings.decay_steps
        return 0.1 ** (iteration / steps) if steps else 1.0

    def _step(self, iteration: int, batch_scale: float) -> tuple[Tensor, Metrics]:
        n_rays = max(16, int(self.settings.rays * batch_scale))
        if iteration < self._crop:
            index = self.dataset.draw_central(n_rays, CROP_SHARE, self.runtime)
        else:
            index = self.dataset.draw(n_rays, self.runtime)
        target = self.dataset.color[index].float() / 255
        if self.dataset.alpha is not None:
            matte = self.dataset.alpha[index].float()[:, None] / 255
            target = target * matte + (1 - matte)
        coarse, fine = self._render(self.dataset.rays(index))
        error = ((fine - target) ** 2).mean()
        self._loss_average += 0.05 * (error.detach() - self._loss_average)
        loss = error + ((coarse - target) ** 2).mean()
        return loss, {"psnr": -10 * torch.log10(self._loss_average.clamp_min(1e-10))}

    def _render(self, rays: Rays) -> tuple[Tensor, Tensor]:
        """Render rays with the coarse and with the fine network; differentiable colors [R, 3] each."""
        field, sampling, runtime = self.field, self.field.sampling, self.runtime
        grid_rays = field.space.to_grid_rays(rays)
        viewdirs = field.space.rotate_directions(rays.viewdirs)
        t = field.coarse_t(runtime.rand(len(rays), sampling.coarse))
        coarse, ray_weights = self._pass(field.coarse, grid_rays, viewdirs, t)
        t = refine(t, ray_weights.detach(), runtime.rand(len(rays), sampling.fine))
        return coarse, self._pass(field.fine, grid_rays, viewdirs, t)[0]

    def _pass(
        self, network: NerfNetwork, grid_rays: tuple[Tensor, Tensor], viewdirs: Tensor, t: Tensor
    ) -> tuple[Tensor, Tensor]:
        origins, directions = grid_rays
        hidden = network.hidden(points_along(origins, directions, t))
        raw = network.raw_density(hidden).view(t.shape)
        if self._noise:
            raw = raw + self._noise * self.runtime.randn(*t.shape)
        deltas = interval_lengths(t) * torch.linalg.norm(directions, dim=1, keepdim=True)
        ray_weights = dense_ray_weights(torch.relu(raw), deltas)
        colors = network.color(network.features(hidden), viewdirs.repeat_interleave(t.shape[1], 0))
        color = (ray_weights[..., None] * colors.view(*t.shape, 3)).sum(1)
        if self._white:
            color = color + 1 - ray_weights.sum(1, keepdim=True)
        return color, ray_weights


def surface_bounds(field: NerfField, rays: Rays) -> Tensor:
    """Return the bounding box [2, 3] of the ends of these rays without outliers, grid coordinates."""
    positions = cache_surface(field, rays, 1, 1.0).positions[:, 0]
    if not len(positions):
        return field.bounds
    ends = torch.quantile(positions, torch.tensor([STRAYS, 1 - STRAYS], device=positions.device), dim=0)
    margin = BOUNDS_MARGIN * (ends[1] - ends[0]).max().clamp_min(1e-6)
    return torch.stack([ends[0] - margin, ends[1] + margin])
