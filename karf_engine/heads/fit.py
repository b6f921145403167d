"""Train the two KaRF fields on surface samples of the frozen scene (paper, Sec. 4.3).

Losses are means over rays or points and sums over channels, which keeps the ratio of the paper's lambdas.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from ..compute.precision import to_float64
from ..compute.progress import Progress
from ..compute.runtime import Runtime
from ..fields.fit import Checkpoint
from ..fields.protocol import Field
from ..fields.rendering.surface_cache import SurfaceCache
from ..fields.training import Adam, Step, TrainingState, constant, cosine_with_warmup, train
from ..project.settings import RecoloringSettings, SegmentationSettings
from .fields import RecoloringField, SegmentationField
from .rendering import SAMPLES_PER_CHUNK, features_of, render_classes, render_weights

WARMUP = 20  # iterations
NEAR_SHARE, OBJECT_SHARE = 0.4, 0.4  # of a batch; the rest is drawn from all points
FIXED_SHARE = 0.1  # in addition, where there are corrections
MAX_CACHE_BYTES = 1 << 29  # of prior features; a NeRF has 256 per sample


def fit_on_points(
    segmentation: SegmentationField,
    scene_field: Field,  # frozen
    positions: Tensor,  # [p, 3] grid coordinates
    classes: Tensor,  # [p] int in 0..K
    certainty: Tensor,  # [p] in [0, 1], sampling weights
    near: Tensor,  # [p] bool, points near an object
    fixed: Tensor,  # [p] bool, points fixed by corrections
    settings: SegmentationSettings,
    runtime: Runtime,
    progress: Progress,  # counts iterations
    checkpoint: Checkpoint | None = None,
) -> None:
    """Train F_s in place by cross-entropy on labelled surface points, or resume its training from the checkpoint.

    Batches are drawn from the objects, the background near them, all points, and the points fixed by corrections.
    """
    features = scene_field.features(positions)
    segmentation.standardizer.fit(features)
    pools = [_pool(certainty * (classes == k)) for k in range(1, int(classes.max()) + 1)]
    fixed_pool, n_fixed = _pool(fixed.float()), int(settings.batch * FIXED_SHARE)
    near_pool, any_pool = _pool(certainty * (near & (classes == 0))), _pool(certainty)
    n_near = int(settings.batch * NEAR_SHARE)
    n_object = int(settings.batch * OBJECT_SHARE) // max(len(pools), 1)

    def step(_: int, scale: float) -> tuple[Tensor, dict[str, Any]]:
        parts = [_draw(pool, int(n_object * scale) + 1, runtime) for pool in pools]
        parts += [_draw(near_pool, int(n_near * scale) + 1, runtime)]
        parts += [_draw(any_pool, max(1, int(settings.batch // 5 * scale)), runtime)]
        parts += [_draw(fixed_pool, int(n_fixed * scale) + 1, runtime)] if len(fixed_pool) else []
        index = torch.cat(parts)
        loss = torch.nn.functional.cross_entropy(segmentation.logits(positions[index], features[index]), classes[index])
        return loss, {"loss": loss.detach()}

    optimizer = Adam(segmentation.parameters(), lr=settings.rate)
    _train(segmentation.state_dict, optimizer, step, settings, 0.05, runtime, progress, checkpoint)


def fit_on_rays(
    segmentation: SegmentationField,
    scene_field: Field,
    cache: SurfaceCache,
    targets: Tensor,  # [n, K+1] votes of the n cached rays
    settings: SegmentationSettings,
    runtime: Runtime,
    progress: Progress,
    checkpoint: Checkpoint | None = None,
) -> None:
    """Train F_s in place by Eq. 12: cross-entropy between rendered probabilities and the masks as given.

    If objects lack masks in a view, a ray outside the masks may have any of several classes; the loss is then that of
    their total probability.
    """
    flat = cache.positions.view(-1, 3)
    segmentation.standardizer.fit(scene_field.features(flat[:: max(1, len(flat) // 65536)]))
    features = _ray_features(scene_field, cache.positions, settings)

    def step(_: int, scale: float) -> tuple[Tensor, dict[str, Any]]:
        index = runtime.randint(len(cache), max(16, int(settings.batch * scale)))
        probabilities = render_classes(segmentation, cache.positions[index], features(index), cache.opacity[index])
        allowed = (probabilities * (targets[index] > 0)).sum(1)
        loss = -allowed.clamp_min(1e-6).log().mean()
        return loss, {"loss": loss.detach()}

    optimizer = Adam(segmentation.parameters(), lr=settings.rate)
    _train(segmentation.state_dict, optimizer, step, settings, 0.05, runtime, progress, checkpoint)


@dataclass(frozen=True)
class ObjectRays:
    """Training rays of F_w with their quantile samples."""

    positions: Tensor  # [n, S, 3] grid coordinates
    viewdirs: Tensor  # [n, 3], unit length
    colors: Tensor  # [n, 3] of the photo, sRGB in [0, 1]
    view: Tensor  # [n] index of the photo among the cached ones
    block: Tensor  # [n] index of the palette
    weights: Tensor  # [n, M] targets of Eq. 13; 0 for unsupervised rays
    supervised: Tensor  # [n] bool, the rays of Eq. 13
    opacity: Tensor  # [n] in [0, 1]; the transmitted rest of a ray is black


def fit_recoloring(
    recoloring: RecoloringField,
    scene_field: Field,
    rays: ObjectRays,
    palettes: Tensor,  # [blocks, M, 3] as extracted, sRGB in [0, 1]; entry 0 is black and fixed
    settings: RecoloringSettings,
    runtime: Runtime,
    progress: Progress,
    checkpoint: Checkpoint | None = None,
) -> Tensor:
    """Train F_w in place by Eq. 14 with lambda_Edit = 1, in the last `palette_share` of the iterations palettes too.

    Returns the learned palettes, [blocks, M, 3] sRGB in [0, 1].
    """
    some = slice(None, None, max(1, len(rays.colors) // 65536))
    middle = rays.positions.shape[1] // 2
    recoloring.standardizer.fit(scene_field.features(rays.positions[some, middle]))
    features = _ray_features(scene_field, rays.positions, settings)
    learned = palettes.clone().requires_grad_(True)
    groups = [
        {"params": list(recoloring.parameters()), "lr": settings.rate},
        {"params": [learned], "lr": settings.palette_rate},
    ]
    first_palette_iteration = int(settings.iterations * (1 - settings.palette_share))

    def step(iteration: int, scale: float) -> tuple[Tensor, dict[str, Any]]:
        index = runtime.randint(len(rays.colors), max(16, int(settings.batch * scale)))
        block = rays.block[index]
        all_weights = render_weights(recoloring, rays.positions[index], rays.viewdirs[index], features(index))
        weights = all_weights[torch.arange(len(index), device=index.device), block]  # [n, M]
        opacity = rays.opacity[index, None]
        weights = torch.cat([weights[:, :1] * opacity + (1 - opacity), weights[:, 1:] * opacity], 1)
        colors = learned if iteration >= first_palette_iteration else palettes
        # black stays black and no color leaves [0, 1]
        colors = torch.cat([palettes[:, :1], colors[:, 1:].clamp(0, 1)], 1)
        mixed = torch.einsum("nm,nmc->nc", weights, colors[block])
        palette_loss = ((mixed - rays.colors[index]) ** 2).sum(1).mean()
        supervised = rays.supervised[index]
        errors = ((weights - rays.weights[index]) ** 2).sum(1)
        weight_loss = (errors * supervised).sum() / supervised.sum().clamp_min(1)
        loss = settings.palette_loss * palette_loss + settings.weight_loss * weight_loss
        return loss, {"palette": palette_loss.detach(), "weight": weight_loss.detach()}

    def learned_state() -> dict[str, Tensor]:
        return recoloring.state_dict() | {"palettes": learned.detach()}

    _train(learned_state, Adam(groups), step, settings, 0.02, runtime, progress, checkpoint)
    return torch.cat([palettes[:, :1], learned.detach()[:, 1:].clamp(0, 1)], 1)


def _train(
    learned_state: Callable[[], dict[str, Tensor]],
    optimizer: Adam,
    step: Step,
    settings: SegmentationSettings | RecoloringSettings,
    floor: float,
    runtime: Runtime,
    progress: Progress,
    checkpoint: Checkpoint | None,
) -> None:
    """Run the training, or the rest of it after a checkpoint. floor: of the cosine schedule."""
    training_state = TrainingState(settings.iterations, optimizer, learned_state, runtime)
    schedule = constant if settings.schedule == "constant" else cosine_with_warmup(WARMUP, floor)
    if checkpoint is not None:
        checkpoint.attach(training_state, progress)
    train(training_state, settings.iterations, step, schedule, progress, checkpoint)


def _pool(weights: Tensor) -> Tensor:
    """Return the cumulative sum of sampling weights [p] for `_draw`; empty where all are 0."""
    total = torch.cumsum(to_float64(weights), 0)
    return total if len(total) and float(total[-1]) > 0 else total[:0]


def _draw(pool: Tensor, count: int, runtime: Runtime) -> Tensor:
    """Draw `count` indices in proportion to the weights of a pool, with replacement."""
    if len(pool) == 0:
        return torch.zeros(0, dtype=torch.long, device=runtime.device)
    drawn = torch.searchsorted(pool, to_float64(runtime.rand(count)) * pool[-1])
    return drawn.clamp_max(len(pool) - 1).to(runtime.device)


def _ray_features(
    scene_field: Field, positions: Tensor, settings: SegmentationSettings | RecoloringSettings
) -> Callable[[Tensor], Tensor]:
    """Return a function from ray indices [m] to prior features [m, S, F] at the samples [n, S, 3] of all rays."""
    # computed once if that is less work than at each call and fits into memory
    n_bytes = positions.shape[0] * positions.shape[1] * scene_field.n_features * 4
    if len(positions) > settings.iterations * settings.batch or n_bytes > MAX_CACHE_BYTES:
        return lambda rays: features_of(scene_field, positions[rays])
    rays_per_chunk = max(1, SAMPLES_PER_CHUNK // positions.shape[1])
    with torch.no_grad():
        cached = torch.cat([features_of(scene_field, chunk) for chunk in positions.split(rays_per_chunk)])
    return lambda rays: cached[rays]
