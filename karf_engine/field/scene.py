"""A learned scene: frozen field, background, and how to look at it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from ..capture.camera import Camera
from ..checkpoints import load_tensors, save_tensors
from ..rendering.rays import Rays, camera_rays, depth_per_distance
from ..rendering.surface_cache import SurfaceCache, join_caches, quantile_samples
from ..rendering.volume import VISIBLE_WEIGHT, accumulate, ray_weights_from_sigmas, remainder_from_sigmas
from .voxels import Background, VoxelField

SCHEMA = "karf-geometry/1"
CPU_RAYS_PER_CHUNK = 2048  # a chunk's samples stay near the processor's cache; accelerators want more at once
ACCELERATOR_RAYS_PER_CHUNK = 65536


@dataclass(frozen=True)
class Picture:
    """A rendered view. color [H, W, 3] sRGB in [0, 1], opacity [H, W], depth [H, W] along the axis (0 where empty).

    cache: the surface samples of its rays, for the fields on top.
    """

    color: Tensor
    opacity: Tensor
    depth: Tensor
    cache: SurfaceCache


@dataclass(frozen=True)
class Scene:
    """field and background as learned. background_kind: alpha, black, white or opaque. step: stride in voxels."""

    field: VoxelField
    background: Background | None
    background_kind: str
    step: float

    def behind(self, viewdirs: Tensor) -> Tensor:
        """What is seen where nothing is solid, [n, 3]; white behind a matte, as the field's benchmarks have it."""
        if self.background is not None:
            return self.background(viewdirs)
        return torch.full_like(viewdirs, 0.0 if self.background_kind == "black" else 1.0)

    @torch.no_grad()
    def render(self, camera: Camera, n_quantiles: int) -> Picture:
        """Render all pixels of a pinhole camera."""
        device = self.field.minimum.device
        rays = camera_rays(camera, device)
        chunk = CPU_RAYS_PER_CHUNK if device.type == "cpu" else ACCELERATOR_RAYS_PER_CHUNK
        parts = [self._render_chunk(rays[i : i + chunk], i, n_quantiles) for i in range(0, len(rays), chunk)]
        colors, opacities, distances, caches = zip(*parts, strict=True)
        shape = (camera.height, camera.width)
        factor = torch.from_numpy(depth_per_distance(camera)).float().to(device)
        return Picture(
            torch.cat(colors).clamp(0, 1).view(*shape, 3),
            torch.cat(opacities).view(shape),
            (torch.cat(distances) * factor).view(shape),
            join_caches(list(caches)),
        )

    def _render_chunk(self, rays: Rays, first: int, n_quantiles: int) -> tuple[Tensor, Tensor, Tensor, SurfaceCache]:
        field = self.field
        samples = field.march(rays, self.step)
        rows, weights = field.corners(samples.positions, all_occupied=True)
        sigmas = field.density_at(rows, weights)
        ray_weights = ray_weights_from_sigmas(sigmas, samples.step, samples.ray_indices)
        seen = torch.nonzero(ray_weights > VISIBLE_WEIGHT).squeeze(1)
        ray_indices = samples.ray_indices[seen]
        features = field.features_at(rows[seen], weights[seen])
        color = field.color(samples.positions[seen], rays.viewdirs[ray_indices], features)
        sums = accumulate(
            ray_weights[seen], torch.cat([color, samples.distances[seen, None]], 1), ray_indices, len(rays)
        )
        remainder = remainder_from_sigmas(sigmas, samples.step, samples.ray_indices, len(rays))
        opacity = 1 - remainder
        color = sums[:, :3] + remainder[:, None] * self.behind(rays.viewdirs)
        # an empty ray has no distance: dividing by the smallest float keeps 0 / 0 out
        distance = sums[:, 3] / opacity.clamp_min(torch.finfo(opacity.dtype).tiny)
        return color, opacity, distance, quantile_samples(rays, samples, ray_weights, n_quantiles, first)

    def save(self, path: Path) -> None:
        """Write the scene as data."""
        tensors = {f"field.{name}": value for name, value in self.field.state_dict().items()}
        if self.background is not None:
            tensors |= {f"background.{name}": value for name, value in self.background.state_dict().items()}
        facts = {
            "voxel": self.field.voxel,
            "n_features": self.field.n_features,
            "width": self.field.width,
            "density_bias": self.field.density_bias,
            "background_kind": self.background_kind,
            "step": self.step,
        }
        save_tensors(path, tensors, SCHEMA, facts)

    @classmethod
    def load(cls, path: Path, device: torch.device | str = "cpu") -> Scene:
        """Read a scene. Raises DataError where the file is missing or damaged."""
        tensors, facts = load_tensors(path, SCHEMA, device)
        field = VoxelField(
            tensors["field.minimum"],
            facts["voxel"],
            tensors["field.occupied"],
            facts["n_features"],
            facts["width"],
            facts["density_bias"],
        )
        field.load_state_dict(_part(tensors, "field."))
        background = None
        if facts["background_kind"] == "opaque":
            background = Background().to(device)
            background.load_state_dict(_part(tensors, "background."))
        return cls(field.requires_grad_(False), background, facts["background_kind"], facts["step"])


def _part(tensors: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}
