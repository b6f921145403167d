"""Render the two KaRF fields along the rays of a frozen scene (paper, Eq. 8): classes and palette weights.

Density is frozen, so the fields are evaluated only at the cached samples of `fields.rendering.surface_cache`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from ..compute.cores import parallel_for
from ..fields.protocol import Field
from ..fields.rendering.surface_cache import SurfaceCache
from .fields import RecoloringField, SegmentationField

SAMPLES_PER_CHUNK = 1 << 17
CPU_SAMPLES_PER_CHUNK = 1 << 13  # activations then fit the processor's cache
NEGLIGIBLE = 1 / 1024  # class probability too small to change an 8-bit picture


def render_classes(segmentation: SegmentationField, positions: Tensor, features: Tensor, opacity: Tensor) -> Tensor:
    """Render class probabilities of rays (Eq. 8), [n, K+1]; rows sum to 1, transmittance counts as background.

    positions: [n, S, 3] quantile samples, grid coordinates. features: [n, S, F]. opacity: [n] in [0, 1].
    """
    per_sample = segmentation(positions.view(-1, 3), features.flatten(0, 1))
    return _rendered(per_sample.view(*positions.shape[:2], per_sample.shape[1]), opacity)


def _rendered(classes: Tensor, opacity: Tensor) -> Tensor:
    rendered = classes.mean(1) * opacity[:, None]
    background = rendered[:, :1] + (1 - opacity)[:, None]
    return torch.cat([background, rendered[:, 1:]], 1)


@dataclass(frozen=True)
class _Chunk:
    """Some rays of a cache, and F_s at their s distinct samples; several quantiles of a ray may be the same sample."""

    rays: Tensor  # [r] indices of the rays in the cache
    first: Tensor  # [r, S] bool, the first quantile of each distinct sample
    positions: Tensor  # [s, 3] grid coordinates
    features: Tensor  # [s, F]
    classes: Tensor  # [s, K+1] probabilities of F_s

    @property
    def sample_of(self) -> Tensor:
        """The distinct sample of each quantile, [r, S]."""
        return (torch.cumsum(self.first.view(-1), 0) - 1).view(self.first.shape)


def _for_each_chunk(
    segmentation: SegmentationField, scene_field: Field, cache: SurfaceCache, use: Callable[[int, _Chunk], None]
) -> None:
    """Evaluate F_s in chunks along the rays that touch an object's box; `use` receives each chunk with its number."""
    n_samples = cache.positions.shape[1]
    samples_per_chunk = CPU_SAMPLES_PER_CHUNK if cache.opacity.device.type == "cpu" else SAMPLES_PER_CHUNK
    rays_per_chunk = max(1, samples_per_chunk // n_samples)
    touching = [
        segmentation.inside(positions.reshape(-1, 3)).any(1).view(-1, n_samples).any(1)
        for positions in cache.positions.split(rays_per_chunk)
    ]
    chunks = torch.nonzero(torch.cat(touching)).squeeze(1).split(rays_per_chunk)

    def evaluate(start: int, stop: int) -> None:
        for number in range(start, stop):
            rays = chunks[number]
            distances = cache.distances[rays]
            first = torch.ones_like(distances, dtype=torch.bool)
            first[:, 1:] = distances[:, 1:] != distances[:, :-1]
            positions = cache.positions[rays][first]
            features = scene_field.features(positions)
            use(number, _Chunk(rays, first, positions, features, segmentation(positions, features)))

    parallel_for(evaluate, len(chunks))


@torch.no_grad()
def segment_cache(segmentation: SegmentationField, scene_field: Field, cache: SurfaceCache) -> Tensor:
    """Render class probabilities of all cached rays, [n, K+1], background outside all boxes; not differentiable."""
    rendered = _background(segmentation, cache)

    def use(_: int, chunk: _Chunk) -> None:
        rendered[chunk.rays] = _rendered(chunk.classes[chunk.sample_of], cache.opacity[chunk.rays])

    _for_each_chunk(segmentation, scene_field, cache, use)
    return rendered


def _background(segmentation: SegmentationField, cache: SurfaceCache) -> Tensor:
    classes = torch.zeros(len(cache), len(segmentation.boxes) + 1, device=cache.opacity.device)
    classes[:, 0] = 1
    return classes


def features_of(scene_field: Field, positions: Tensor) -> Tensor:
    """Return prior features [n, S, F] at samples [n, S, 3] of rays."""
    return scene_field.features(positions.view(-1, 3)).view(*positions.shape[:2], scene_field.n_features)


@dataclass(frozen=True)
class ObjectSamples:
    """The output of F_s for a cache, and the s samples where an object's probability is not negligible."""

    rendered: Tensor  # [n, K+1] class probabilities of all cached rays
    positions: Tensor  # [s, 3] grid coordinates
    viewdirs: Tensor  # [s, 3], unit length
    features: Tensor  # [s, F]
    classes: Tensor  # [s, K] probabilities of F_s, without the background
    rays: Tensor  # [s] index in the cache
    counts: Tensor  # [s] >= 1, number of the ray's quantiles at this sample


@torch.no_grad()
def object_samples(segmentation: SegmentationField, scene_field: Field, cache: SurfaceCache) -> ObjectSamples:
    """Evaluate F_s along a cache's rays, and collect the samples for F_w; not differentiable."""
    rendered, parts = _background(segmentation, cache), {}

    def use(number: int, chunk: _Chunk) -> None:
        sample_of = chunk.sample_of
        rendered[chunk.rays] = _rendered(chunk.classes[sample_of], cache.opacity[chunk.rays])
        classes = chunk.classes[:, 1:]
        own = torch.nonzero(classes.amax(1) > NEGLIGIBLE).squeeze(1)
        rays = chunk.rays[torch.nonzero(chunk.first)[own, 0]]
        counts = torch.bincount(sample_of.view(-1), minlength=len(classes))[own]
        parts[number] = chunk.positions[own], cache.viewdirs[rays], chunk.features[own], classes[own], rays, counts

    _for_each_chunk(segmentation, scene_field, cache, use)
    in_order = [parts[number] for number in sorted(parts)]
    return ObjectSamples(rendered, *[torch.cat(values) for values in zip(*in_order, strict=True)])


@torch.no_grad()
def weigh_cache(recoloring: RecoloringField, samples: ObjectSamples, cache: SurfaceCache) -> Tensor:
    """Render the edit planes of n cached rays: sum_i omega_i s_i^k w_ij for object k and palette entry j (Eq. 8, 9).

    Class and weights are multiplied per sample, so samples behind an object's silhouette have no influence. Not
    differentiable; `render_weights` is. Returns [n, K, M] >= 0; the sum over M is the object's probability.
    """
    n_objects, n_samples = samples.classes.shape[1], cache.positions.shape[1]
    planes = torch.zeros(len(cache), n_objects, recoloring.n_colors, device=cache.opacity.device)
    for chunk in torch.arange(len(samples.rays), device=cache.opacity.device).split(SAMPLES_PER_CHUNK):
        weights = recoloring(samples.positions[chunk], samples.viewdirs[chunk], samples.features[chunk])
        classes = samples.classes[chunk] * samples.counts[chunk, None]
        planes.index_add_(0, samples.rays[chunk], classes[:, :, None] * weights)  # a shared palette broadcasts
    return planes * (cache.opacity / n_samples)[:, None, None]


def render_weights(recoloring: RecoloringField, positions: Tensor, viewdirs: Tensor, features: Tensor) -> Tensor:
    """Render palette weights of rays (Eq. 8 with w instead of s), [n, blocks, M]; sums to 1 over M.

    positions: [n, S, 3] quantile samples, grid coordinates. viewdirs: [n, 3], unit length. features: [n, S, F].
    """
    n_rays, n_samples = positions.shape[:2]
    directions = viewdirs[:, None].expand(-1, n_samples, -1).reshape(-1, 3)
    weights = recoloring(positions.reshape(-1, 3), directions, features.flatten(0, 1))
    return weights.view(n_rays, n_samples, recoloring.n_blocks, recoloring.n_colors).mean(1)
