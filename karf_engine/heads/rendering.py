"""Rendering the two KaRF fields along the rays of a frozen scene (paper, Eq. 8): classes and palette weights.

Because density is frozen, a ray's samples are cached once (rendering.surface_cache) and the fields asked only there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from ..compute.cores import share
from ..fields.protocol import Field
from ..fields.rendering.surface_cache import SurfaceCache
from .fields import RecoloringField, SegmentationField

SAMPLES_PER_CHUNK = 1 << 17
CPU_SAMPLES_PER_CHUNK = 1 << 13  # whose layers stay near the processor's cache
NEGLIGIBLE = 1 / 1024  # probability of a class: too little to change an 8-bit picture


def render_classes(karf: SegmentationField, positions: Tensor, features: Tensor, opacity: Tensor) -> Tensor:
    """Rendered class probabilities of rays (the sum of Eq. 8): the final transmittance goes to the background.

    Differentiable to F_s; not through the rays' weights, which are frozen.

    Args:
        karf: F_s.
        positions: [n, S, 3] quantile samples, grid coordinates.
        features: [n, S, F] prior features there.
        opacity: [n] of the rays, in [0, 1].

    Returns:
        [n, K+1]; rows sum to 1.
    """
    per_sample = karf(positions.view(-1, 3), features.flatten(0, 1))
    return _rendered(per_sample.view(*positions.shape[:2], per_sample.shape[1]), opacity)


def _rendered(classes: Tensor, opacity: Tensor) -> Tensor:
    """Class probabilities [n, K+1] of rays of those of their samples [n, S, K+1]."""
    rendered = classes.mean(1) * opacity[:, None]
    background = rendered[:, :1] + (1 - opacity)[:, None]
    return torch.cat([background, rendered[:, 1:]], 1)


@dataclass(frozen=True)
class _Part:
    """Some rays of a cache, and F_s at their distinct samples: several quantiles may fall on one.

    Attributes:
        rays: [r], their numbers in the cache.
        first: [r, S] bool, the quantiles that fall on a sample none before them does; s of them.
        positions: [s, 3] grid coordinates.
        features: [s, F] prior features.
        classes: [s, K+1] probabilities of F_s.
    """

    rays: Tensor
    first: Tensor
    positions: Tensor
    features: Tensor
    classes: Tensor

    @property
    def sample_of(self) -> Tensor:
        """Which of the s samples each quantile falls on, [r, S]."""
        return (torch.cumsum(self.first.view(-1), 0) - 1).view(self.first.shape)


def _ask(karf: SegmentationField, scene_field: Field, cache: SurfaceCache, take: Callable[[int, _Part], None]) -> None:
    """Ask F_s along the rays of a cache that touch an object's box, in parts; `take` gets each, with its number."""
    n_samples = cache.positions.shape[1]
    at_once = max(1, _samples_at_once(cache) // n_samples)
    touching = [
        karf.inside(some.reshape(-1, 3)).any(1).view(-1, n_samples).any(1) for some in cache.positions.split(at_once)
    ]
    rays_of_parts = torch.nonzero(torch.cat(touching)).squeeze(1).split(at_once)

    def ask(first: int, last: int) -> None:
        for number in range(first, last):
            take(number, _part(karf, scene_field, cache, rays_of_parts[number]))

    share(ask, len(rays_of_parts))


def _part(karf: SegmentationField, scene_field: Field, cache: SurfaceCache, rays: Tensor) -> _Part:
    distances = cache.distances[rays]
    first = torch.ones_like(distances, dtype=torch.bool)
    first[:, 1:] = distances[:, 1:] != distances[:, :-1]
    positions = cache.positions[rays][first]
    features = scene_field.features(positions)
    return _Part(rays, first, positions, features, karf(positions, features))


def _samples_at_once(cache: SurfaceCache) -> int:
    return CPU_SAMPLES_PER_CHUNK if cache.opacity.device.type == "cpu" else SAMPLES_PER_CHUNK


@torch.no_grad()
def segment_cache(karf: SegmentationField, scene_field: Field, cache: SurfaceCache) -> Tensor:
    """Rendered class probabilities of all cached rays, [n, K+1]; not differentiable.

    Rays outside every object's box are background and not evaluated.

    Args:
        karf: F_s.
        scene_field: the frozen radiance field, for its prior features.
        cache: n rays with their surface samples.
    """
    result = _background(karf, cache)

    def take(_: int, part: _Part) -> None:
        result[part.rays] = _rendered(part.classes[part.sample_of], cache.opacity[part.rays])

    _ask(karf, scene_field, cache, take)
    return result


def _background(karf: SegmentationField, cache: SurfaceCache) -> Tensor:
    result = torch.zeros(len(cache), len(karf.boxes) + 1, device=cache.opacity.device)
    result[:, 0] = 1
    return result


def features_of(scene_field: Field, positions: Tensor) -> Tensor:
    """Prior features at samples [n, K, 3] of rays, [n, K, F]; n may be 0."""
    return scene_field.features(positions.view(-1, 3)).view(*positions.shape[:2], scene_field.n_features)


@dataclass(frozen=True)
class ObjectSamples:
    """The output of F_s for a cache, and the s samples at which an object's probability is not negligible.

    Attributes:
        rendered: [n, K+1] rendered class probabilities of all cached rays, as of `segment_cache`.
        positions: [s, 3] grid coordinates.
        viewdirs: [s, 3], unit length.
        features: [s, F] prior features.
        classes: [s, K] probabilities of F_s, without the background.
        rays: [s] number of each sample's ray in the cache.
        counts: [s] >= 1, how many of the ray's quantiles fall on the sample.
    """

    rendered: Tensor
    positions: Tensor
    viewdirs: Tensor
    features: Tensor
    classes: Tensor
    rays: Tensor
    counts: Tensor


@torch.no_grad()
def object_samples(segmentation: SegmentationField, scene_field: Field, cache: SurfaceCache) -> ObjectSamples:
    """F_s along a cache's rays, asked once, and where F_w must be asked; not differentiable.

    Arguments as for `segment_cache`.
    """
    rendered, parts = _background(segmentation, cache), {}

    def take(number: int, part: _Part) -> None:
        sample_of = part.sample_of
        rendered[part.rays] = _rendered(part.classes[sample_of], cache.opacity[part.rays])
        classes = part.classes[:, 1:]
        own = torch.nonzero(classes.amax(1) > NEGLIGIBLE).squeeze(1)
        rays = part.rays[torch.nonzero(part.first)[own, 0]]
        counts = torch.bincount(sample_of.view(-1), minlength=len(classes))[own]
        parts[number] = part.positions[own], cache.viewdirs[rays], part.features[own], classes[own], rays, counts

    _ask(segmentation, scene_field, cache, take)
    in_order = [parts[number] for number in sorted(parts)]
    return ObjectSamples(rendered, *[torch.cat(values) for values in zip(*in_order, strict=True)])


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
        shares = samples.classes[part] * samples.counts[part, None]
        planes.index_add_(0, samples.rays[part], shares[:, :, None] * weights)  # a shared palette broadcasts
    return planes * (cache.opacity / n_samples)[:, None, None]


def render_weights(karf: RecoloringField, positions: Tensor, viewdirs: Tensor, features: Tensor) -> Tensor:
    """Mean of F_w over the quantile samples of rays: Eq. 8 with w in the place of s, differentiable to F_w.

    Args:
        karf: F_w.
        positions: [n, S, 3] quantile samples, grid coordinates.
        viewdirs: [n, 3], unit length.
        features: [n, S, F] prior features there.

    Returns:
        [n, blocks, M] >= 0; sums to 1 over M.
    """
    n_rays, n_samples = positions.shape[:2]
    directions = viewdirs[:, None].expand(-1, n_samples, -1).reshape(-1, 3)
    weights = karf(positions.reshape(-1, 3), directions, features.flatten(0, 1))
    return weights.view(n_rays, n_samples, karf.n_blocks, karf.n_colors).mean(1)
