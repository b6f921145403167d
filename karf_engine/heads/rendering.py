"""Rendering the two KaRF fields along the rays of a frozen scene (paper, Eq. 8): classes and palette weights.

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
    """Rendered class probabilities of rays (the sum of Eq. 8): the remainder goes to the background.

    Differentiable to F_s; not through the rays' weights, which are frozen.

    Args:
        karf: F_s.
        positions: [n, S, 3] quantile samples, grid coordinates.
        features: [n, S, F] prior features there.
        opacity: [n] of the rays, in [0, 1].

    Returns:
        [n, K+1]; rows sum to 1.
    """
    n_rays, n_samples = positions.shape[:2]
    per_sample = karf(positions.view(-1, 3), features.flatten(0, 1))
    rendered = per_sample.view(n_rays, n_samples, per_sample.shape[1]).mean(1) * opacity[:, None]
    background = rendered[:, :1] + (1 - opacity)[:, None]
    return torch.cat([background, rendered[:, 1:]], 1)


@torch.no_grad()
def segment_cache(karf: SegmentationField, scene_field: Field, cache: SurfaceCache) -> Tensor:
    """Rendered class probabilities of all cached rays, [n, K+1]; not differentiable.

    Rays outside every object's box are background and not evaluated.

    Args:
        karf: F_s.
        scene_field: the frozen radiance field, for its prior features.
        cache: n rays with their surface samples.
    """
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
    """The s cached samples at which an object's probability is not negligible.

    Attributes:
        positions: [s, 3] grid coordinates.
        viewdirs: [s, 3], unit length.
        features: [s, F] prior features.
        classes: [s, K] probabilities of F_s, without the background.
        rays: [s] number of each sample's ray in the cache.
    """

    positions: Tensor
    viewdirs: Tensor
    features: Tensor
    classes: Tensor
    rays: Tensor


@torch.no_grad()
def object_samples(segmentation: SegmentationField, scene_field: Field, cache: SurfaceCache) -> ObjectSamples:
    """The samples of a cache for which F_w must be asked; not differentiable. Arguments as for `segment_cache`."""
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
    """Edit planes of all cached rays: sum_i omega_i s_i^k w_ij of every object k and palette entry j (Eq. 8 and 9).

    Class and weights are multiplied sample by sample: at a silhouette the samples behind the object have no influence.
    Not differentiable; `render_weights` is.

    Args:
        recoloring: F_w.
        samples: those of this cache.
        cache: n rays with their surface samples.

    Returns:
        [n, K, M] >= 0; the sum over M is the object's probability.
    """
    n_objects, n_samples = samples.classes.shape[1], cache.positions.shape[1]
    planes = torch.zeros(len(cache), n_objects, recoloring.n_colors, device=cache.opacity.device)
    for part in torch.arange(len(samples.rays), device=cache.opacity.device).split(SAMPLES_PER_CHUNK):
        weights = recoloring(samples.positions[part], samples.viewdirs[part], samples.features[part])
        # a shared palette broadcasts
        planes.index_add_(0, samples.rays[part], samples.classes[part, :, None] * weights)
    return planes * (cache.opacity / n_samples)[:, None, None]


def render_weights(karf: RecoloringField, scene_field: Field, positions: Tensor, viewdirs: Tensor) -> Tensor:
    """Mean of F_w over the quantile samples of rays: Eq. 8 with w in the place of s, differentiable to F_w.

    Args:
        karf: F_w.
        scene_field: the frozen radiance field, for its prior features.
        positions: [n, S, 3] quantile samples, grid coordinates.
        viewdirs: [n, 3], unit length.

    Returns:
        [n, blocks, M] >= 0; sums to 1 over M.
    """
    n_rays, n_samples = positions.shape[:2]
    flat = positions.reshape(-1, 3)
    directions = viewdirs[:, None].expand(-1, n_samples, -1).reshape(-1, 3)
    weights = karf(flat, directions, scene_field.features(flat))
    return weights.view(n_rays, n_samples, karf.n_blocks, karf.n_colors).mean(1)
