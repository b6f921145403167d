"""Rendering the two KaRF fields along the rays of a frozen scene (paper, Eq. 8): classes of F_s, palette weights of F_w.

Because density is frozen, a ray's samples are cached once (rendering.surface_cache) and the fields asked only there.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from ..fields.protocol import Field
from ..rendering.surface_cache import SurfaceCache
from .fields import RecoloringField, SegmentationField

SAMPLES_PER_CHUNK = 1 << 17
NEGLIGIBLE = 1 / 1024  # probability of a class: too little to change an 8-bit picture


def render_classes(karf: SegmentationField, positions: Tensor, features: Tensor, opacity: Tensor) -> Tensor:
    """Rendered class probabilities of rays (the sum of Eq. 8), [n, K+1]: the remainder goes to the background.

    positions: [n, K, 3] quantile samples; features: [n, K, F]; opacity: [n].
    """
    n_rays, n_samples = positions.shape[:2]
    per_sample = karf(positions.view(-1, 3), features.flatten(0, 1))
    rendered = per_sample.view(n_rays, n_samples, per_sample.shape[1]).mean(1) * opacity[:, None]
    background = rendered[:, :1] + (1 - opacity)[:, None]
    return torch.cat([background, rendered[:, 1:]], 1)


@torch.no_grad()
def segment_cache(karf: SegmentationField, scene_field: Field, cache: SurfaceCache) -> Tensor:
    """Rendered class probabilities of all cached rays, [n, K+1]. Rays outside every object's box are not evaluated."""
    result = torch.zeros(len(cache), len(karf.boxes) + 1, device=cache.opacity.device)
    result[:, 0] = 1
    n_samples = cache.positions.shape[1]
    inside = karf.inside(cache.positions.view(-1, 3)).any(1).view(-1, n_samples).any(1)
    for part in torch.nonzero(inside).squeeze(1).split(max(1, SAMPLES_PER_CHUNK // n_samples)):
        positions = cache.positions[part]
        features = features_of(scene_field, positions)
        result[part] = render_classes(karf, positions, features, cache.opacity[part])
    return result


def features_of(scene_field: Field, positions: Tensor) -> Tensor:
    """Prior features at samples [n, K, 3] of rays, [n, K, F]; n may be 0."""
    return scene_field.features(positions.view(-1, 3)).view(*positions.shape[:2], scene_field.n_features)


@dataclass(frozen=True)
class ObjectSamples:
    """Cached samples at which an object has a say: positions, viewdirs [s, 3], features [s, F], classes [s, K] of F_s
    without the background, and the number of each one's ray in the cache, rays [s]."""

    positions: Tensor
    viewdirs: Tensor
    features: Tensor
    classes: Tensor
    rays: Tensor


@torch.no_grad()
def object_samples(segmentation: SegmentationField, scene_field: Field, cache: SurfaceCache) -> ObjectSamples:
    """The samples of a cache for which F_w must be asked."""
    n_samples = cache.positions.shape[1]
    inside = segmentation.inside(cache.positions.view(-1, 3)).any(1).view(-1, n_samples).any(1)
    parts = []
    for part in torch.nonzero(inside).squeeze(1).split(max(1, SAMPLES_PER_CHUNK // n_samples)):
        flat = cache.positions[part].view(-1, 3)
        features = scene_field.features(flat)
        classes = segmentation(flat, features)[:, 1:]
        own = torch.nonzero(classes.amax(1) > NEGLIGIBLE).squeeze(1)
        rays = part[own // n_samples]
        parts.append((flat[own], cache.viewdirs[rays], features[own], classes[own], rays))
    return ObjectSamples(*[torch.cat(values) for values in zip(*parts, strict=True)])


@torch.no_grad()
def weigh_cache(recoloring: RecoloringField, samples: ObjectSamples, cache: SurfaceCache) -> Tensor:
    """Edit planes of all cached rays, [n, K, M]: sum_i omega_i s_i^k w_ij, of every object k and palette entry j.

    samples: those of this cache. Class and weights are multiplied sample by sample: at a silhouette the samples behind
    the object have no say.
    """
    n_objects, n_samples = samples.classes.shape[1], cache.positions.shape[1]
    planes = torch.zeros(len(cache), n_objects, recoloring.n_colors, device=cache.opacity.device)
    for part in torch.arange(len(samples.rays), device=cache.opacity.device).split(SAMPLES_PER_CHUNK):
        weights = recoloring(samples.positions[part], samples.viewdirs[part], samples.features[part])
        # a shared palette broadcasts
        planes.index_add_(0, samples.rays[part], samples.classes[part, :, None] * weights)
    return planes * (cache.opacity / n_samples)[:, None, None]


def render_weights(karf: RecoloringField, scene_field: Field, positions: Tensor, viewdirs: Tensor) -> Tensor:
    """Differentiable mean of F_w over the quantile samples of rays, [n, blocks, M]: Eq. 8 with w in the place of s.

    positions: [n, K, 3]; viewdirs: [n, 3].
    """
    n_rays, n_samples = positions.shape[:2]
    flat = positions.reshape(-1, 3)
    directions = viewdirs[:, None].expand(-1, n_samples, -1).reshape(-1, 3)
    weights = karf(flat, directions, scene_field.features(flat))
    return weights.view(n_rays, n_samples, karf.n_blocks, karf.n_colors).mean(1)
