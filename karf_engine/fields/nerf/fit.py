"""Fitting a NeRF to photos as the original implementation does: random rays, a coarse and a fine pass, Adam.

The background is a constant color: white behind mattes and white backgrounds, else black.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch
from torch import Tensor

from ...capture.capture import SparsePoints, View
from ...compute.precision import float64_device, to_float64
from ...compute.progress import Progress
from ...compute.runtime import Runtime
from ...project.settings import NerfSettings
from ..extent import focus_point, max_depth, mean_frustum, min_depth, similarity, to_ndc
from ..fit import Checkpoint, FitInputs
from ..rendering.rays import PixelDataset, Rays
from ..rendering.sampling import dense_ray_weights, interval_lengths, refine
from ..rendering.space import StraightSpace, space_to_device
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
from .field import NerfField, NerfNetwork, NerfSampling, NerfShape, points_along

OBJECT_DISTANCE = 4.0  # mean camera distance in the units of a NeRF, as in NeRF-synthetic
OBJECT_RANGE = (0.5, 1.5)  # sampled range of an object, mean camera distances
OPEN_RANGE = (0.1, 20.0)  # sampled range of an open scene of unknown depth, mean camera distances
POINT_RANGE = (0.9, 1.1)  # sampled range, shares of the smallest and the largest depth
CROP_SHARE = 0.5  # central share of the image sides where the first rays are drawn, to see the object early
MEASURED_RAYS = 2048
STRAYS = 0.005  # quantile of surface positions outside the bounds, on each side
BOUNDS_MARGIN = 0.05
FIRST_DENSITY = 0.1  # about what fresh networks begin with: where the ReLU makes all densities 0, nothing is learned


def start_nerf_fit(inputs: FitInputs) -> NerfFit:
    """Begin a fit of a NeRF that suits the cameras.

    Raises:
        BadRequest: The requested frustum needs the depth of the scene, which is unknown.
    """
    settings, kind, runtime = inputs.settings.nerf, inputs.background_kind, inputs.runtime
    space, sampling = choose_space_and_sampling(kind, inputs.space, inputs.views, inputs.points, settings)
    return NerfFit(inputs.dataset, kind, space_to_device(space, runtime.device), sampling, settings, runtime)


def choose_space_and_sampling(
    kind: str, space_name: str, views: list[View], points: SparsePoints | None, settings: NerfSettings
) -> tuple[StraightSpace, NerfSampling]:
    """Choose the space of a NeRF and the sampling of its rays.

    Forward-facing cameras: NDC. Objects: at a mean camera distance of OBJECT_DISTANCE. Open scenes: at a mean camera
    distance of 1, with samples evenly spaced in disparity.
    """
    coarse, fine = settings.coarse_samples, settings.fine_samples
    if space_name == "frustum":
        return to_ndc(mean_frustum(views, points), views), NerfSampling(0.0, 1.0, False, coarse, fine)
    cameras = [view.camera for view in views]
    center = focus_point(cameras).numpy()
    distances = np.array([np.linalg.norm(camera.position - center) for camera in cameras])
    is_open = kind == "opaque"
    near, far = _open_range(views, points, distances) if is_open else distances.mean() * np.array(OBJECT_RANGE)
    scale = (1.0 if is_open else OBJECT_DISTANCE) / distances.mean()
    space = similarity(scale, np.eye(3), center)
    return space, NerfSampling(settings.near or float(near), settings.far or float(far), is_open, coarse, fine)


def _open_range(views: list[View], points: SparsePoints | None, distances: np.ndarray) -> tuple[float, float]:
    """Return the sampled range of an open scene, world units."""
    near, far = min_depth(views, points), max_depth(views, points)
    near = distances.mean() * OPEN_RANGE[0] if near is None else near * POINT_RANGE[0]
    far = distances.mean() * OPEN_RANGE[1] if far is None else far * POINT_RANGE[1]
    return float(near), float(far)


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
    """A `Fit` of fresh networks, whose members ../fit.py documents."""

    def __init__(
        self,
        dataset: PixelDataset,
        kind: str,
        space: StraightSpace,
        sampling: NerfSampling,
        settings: NerfSettings,
        runtime: Runtime,
    ) -> None:
        shape = NerfShape(
            depth=settings.depth,
            width=settings.width,
            view_width=settings.width // 2,
            position_frequencies=settings.position_frequencies,
            direction_frequencies=settings.direction_frequencies,
        )
        unit_box = torch.tensor([[-1.0] * 3, [1.0] * 3])
        field = NerfField(_network(shape), _network(shape), sampling, space, unit_box).to(runtime.device)
        self.dataset, self.background_kind, self.settings = dataset, kind, settings
        self.runtime, self.field = runtime, field
        self._white = kind in ("alpha", "white")
        self._noise = settings.density_noise if field.space.is_forward_facing else 0.0
        self._crop = 0 if kind == "opaque" else settings.crop_iterations
        # reading it would wait for the device
        self._loss_average = scalar_tensor(0.1).to(float64_device(runtime.device))
        self._yielded = 0  # iterations of the last yielded scene
        optimizer = Adam(field.parameters(), lr=settings.rate)
        self._training_state = TrainingState(settings.iterations, optimizer, field.state_dict, runtime)

    @property
    def iterations(self) -> int:
        return self.settings.iterations

    @property
    def done(self) -> int:
        return self._training_state.done

    def scenes(self, progress: Progress, checkpoint: Checkpoint | None = None) -> Iterator[Scene]:
        field = self.field
        while self._yielded < self.iterations:
            until = min(self._yielded + self.settings.look_every, self.iterations)
            with tf32_matmul(self.runtime.device):
                train(self._training_state, until, self._step, self._decay, progress, checkpoint)
            field.bounds = surface_bounds(field, self.dataset.rays(self.dataset.draw(MEASURED_RAYS, self.runtime)))
            self._yielded = until
            yield Scene(field, None, self.background_kind, 1.0)

    def state(self) -> dict[str, Tensor]:
        return self._counters() | add_prefix("course", self._training_state.state())

    def resume(self, state: dict[str, Tensor]) -> None:
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
        self._loss_average += 0.05 * (to_float64(error.detach()) - self._loss_average)
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


def _network(shape: NerfShape) -> NerfNetwork:
    """Return a fresh network with density everywhere."""
    network = NerfNetwork(shape)
    torch.nn.init.constant_(network.alpha_linear.bias, FIRST_DENSITY)
    return network


def surface_bounds(field: NerfField, rays: Rays) -> Tensor:
    """Return the bounding box [2, 3] of the ends of these rays without outliers, grid coordinates."""
    positions = cache_surface(field, rays, 1, 1.0).positions[:, 0]
    if not len(positions):
        return field.bounds
    ends = torch.quantile(positions, torch.tensor([STRAYS, 1 - STRAYS], device=positions.device), dim=0)
    margin = BOUNDS_MARGIN * (ends[1] - ends[0]).max().clamp_min(1e-6)
    return torch.stack([ends[0] - margin, ends[1] + margin])
