"""A learned scene, a frozen field with a background, and its rendering."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from ..capture.camera import Camera
from .protocol import Field
from .rendering.rays import PixelDataset, Rays, camera_rays, depth_per_distance, spherical_harmonics
from .rendering.surface_cache import SurfaceCache, concatenate_caches, map_chunks, quantile_samples
from .rendering.volume import VISIBLE_WEIGHT, accumulate

CPU_RAYS_PER_CHUNK = 2048  # samples fit the cache
ACCELERATOR_RAYS_PER_CHUNK = 65536
VALIDATION_PIXELS = 1500


class Background(nn.Module):
    """Learned color of rays that leave the field, by direction: an MLP with one hidden layer."""

    def __init__(self, width: int = 32) -> None:
        super().__init__()
        self.network = nn.Sequential(nn.Linear(9 + 18, width), nn.ReLU(), nn.Linear(width, 3))

    def forward(self, viewdirs: Tensor) -> Tensor:
        """Return sRGB colors [n, 3] in (0, 1) of unit directions [n, 3]."""
        waves = [f(k * viewdirs) for k in (2.0, 4.0, 8.0) for f in (torch.sin, torch.cos)]
        return torch.sigmoid(self.network(torch.cat([spherical_harmonics(viewdirs), *waves], 1)))


@dataclass(frozen=True)
class Picture:
    """A rendered view."""

    color: Tensor  # [H, W, 3] sRGB in [0, 1]
    opacity: Tensor  # [H, W] in [0, 1]
    depth: Tensor  # [H, W] along the optical axis, world units; 0 where empty
    cache: SurfaceCache | None  # quantile samples of its rays; None for a composite of pictures


@dataclass(frozen=True)
class Scene:
    """A learned scene."""

    field: Field  # frozen
    background: Background | None  # learned background; None for a constant color
    background_kind: str  # alpha, black, white or opaque; the background of the photos
    step: float  # stride in voxels, for fields that march

    def background_color(self, viewdirs: Tensor) -> Tensor:
        """Return the background colors [n, 3] of directions; white for mattes, as in NeRF's benchmarks."""
        if self.background is not None:
            return self.background(viewdirs)
        return torch.full_like(viewdirs, 1.0 if self.background_kind in ("alpha", "white") else 0.0)

    @torch.no_grad()
    def render(self, camera: Camera, n_quantiles: int) -> Picture:
        """Render a camera, with its lens distortion and `n_quantiles` >= 1 samples per ray. Not differentiable."""
        device = self.field.bounds.device
        colors, opacities, distances, caches = self._render_rays(camera_rays(camera, device), n_quantiles)
        shape = (camera.height, camera.width)
        factor = torch.from_numpy(depth_per_distance(camera)).float().to(device)
        return Picture(
            torch.cat(colors).clamp(0, 1).view(*shape, 3),
            torch.cat(opacities).view(shape),
            (torch.cat(distances) * factor).view(shape),
            concatenate_caches(list(caches)),
        )

    @torch.no_grad()
    def colors(self, rays: Rays) -> Tensor:
        """Render the sRGB colors [R, 3] of rays. Not differentiable."""
        return torch.cat(self._render_rays(rays, 1)[0]).clamp(0, 1)

    def _render_rays(self, rays: Rays, n_quantiles: int) -> tuple[tuple, ...]:
        """Return chunks of colors, opacities, distances and caches."""
        chunk = CPU_RAYS_PER_CHUNK if rays.origins.device.type == "cpu" else ACCELERATOR_RAYS_PER_CHUNK
        parts = map_chunks(lambda rays, first: self._render_chunk(rays, first, n_quantiles), rays, chunk)
        return tuple(zip(*parts, strict=True))

    def _render_chunk(self, rays: Rays, first: int, n_quantiles: int) -> tuple[Tensor, Tensor, Tensor, SurfaceCache]:
        field = self.field
        trace = field.trace(rays, self.step)
        samples, ray_weights, final_transmittance = trace.samples, trace.ray_weights, trace.final_transmittance
        seen = torch.nonzero(ray_weights > VISIBLE_WEIGHT).squeeze(1)
        ray_indices, positions = samples.ray_indices[seen], samples.positions[seen]
        color = field.color(positions, rays.viewdirs[ray_indices], field.features(positions))
        surface = field.space.to_world(positions)
        distances = torch.linalg.norm(surface - rays.origins[ray_indices], dim=1, keepdim=True)
        sums = accumulate(ray_weights[seen], torch.cat([color, distances], 1), ray_indices, len(rays))
        opacity = 1 - final_transmittance
        color = sums[:, :3] + final_transmittance[:, None] * self.background_color(rays.viewdirs)
        distance = sums[:, 3] / opacity.clamp_min(torch.finfo(opacity.dtype).tiny)  # not 0 / 0 for empty rays
        return color, opacity, distance, quantile_samples(rays, samples, ray_weights, n_quantiles, first)


def psnr_of_views(scene: Scene, dataset: PixelDataset, n_pixels: int = VALIDATION_PIXELS, seed: int = 0) -> list[float]:
    """Return the PSNR of each training image over random pixels, dB, at most 100. The seed determines the pixels."""
    random, found = torch.Generator().manual_seed(seed), []
    for first, last in itertools.pairwise(dataset.offsets.tolist()):
        index = torch.randint(first, last, (n_pixels,), generator=random).to(dataset.color.device)
        error = ((scene.colors(dataset.rays(index)) - dataset.color[index].float() / 255) ** 2).mean()
        found.append(-10 * math.log10(float(error) + 1e-10))
    return found
