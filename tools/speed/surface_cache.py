"""An iteration of F_w on dense samples against one on the surface cache, at the paper's width of 256.

Dense: 192 samples on every ray, as a NeRF takes them (64 + 128): densities, features and F_w of each, weighted by what
volume rendering gives. Cache: the K quantile samples a ray that stand for them because density is frozen. Forward,
backward and the optimizer's step on the same rays and the same field; medians, interleaved.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import torch
from torch import Tensor

from karf_engine.fields.voxels.field import VoxelField
from karf_engine.heads.fields import RecoloringField
from karf_engine.heads.rendering import features_of, render_weights
from karf_engine.project.settings import RecoloringSettings

from .rows import Row, median_seconds

RAYS, DENSE_SAMPLES, CACHED_SAMPLES, COLORS = 256, 192, (3, 1), 6
TARGET = 50.0  # times faster with the cache, at its 3 samples a ray


def run(threads: int = 1, repeats: int = 3) -> list[Row]:
    """One row a case: median milliseconds of an iteration, and how many times faster than the dense one."""
    torch.set_num_threads(threads)
    torch.manual_seed(0)
    field = VoxelField(torch.tensor([-1.0, -1.0, -1.0]), 2 / 48, torch.ones(48, 48, 48, dtype=torch.bool))
    field.requires_grad_(False)
    viewdirs = torch.nn.functional.normalize(torch.randn(RAYS, 3), dim=1)
    positions = torch.rand(RAYS, DENSE_SAMPLES, 3) * 1.9 - 0.95
    target = torch.rand(RAYS, COLORS)
    cases = {"dense": lambda karf: dense_weights(karf, field, positions, viewdirs)}
    for count in CACHED_SAMPLES:
        few = positions[:, :count].contiguous()
        features = features_of(field, few)  # once for a whole training
        cases[f"cache of {count}"] = lambda karf, few=few, features=features: render_weights(
            karf, few, viewdirs, features
        )[:, 0]
    karf = RecoloringField(field.bounds, field.n_features, [COLORS], RecoloringSettings(width=256))
    optimizer = torch.optim.Adam(karf.parameters())
    steps = {name: partial(iterate, partial(weights_of, karf), target, optimizer) for name, weights_of in cases.items()}
    median = median_seconds(steps, repeats)
    return [
        {"case": name, "rays": RAYS, "ms": round(1e3 * value, 1), "faster": round(median["dense"] / value, 1)}
        for name, value in median.items()
    ]


def dense_weights(karf: RecoloringField, field: VoxelField, positions: Tensor, viewdirs: Tensor) -> Tensor:
    """F_w on every sample, weighted by what the field's density says; [rays, colors]."""
    flat = positions.view(-1, 3)
    step = 2 / DENSE_SAMPLES
    depth = (field.density(flat).view(positions.shape[:2]) * step).cumsum(1)
    transmittance = torch.exp(-torch.cat([torch.zeros_like(depth[:, :1]), depth], 1))
    ray_weights = transmittance[:, :-1] - transmittance[:, 1:]
    directions = viewdirs[:, None].expand_as(positions).reshape(-1, 3)
    weights = karf(flat, directions, field.features(flat))[:, 0]
    return (weights.view(*positions.shape[:2], -1) * ray_weights[..., None]).sum(1)


def iterate(weights_of: Callable[[], Tensor], target: Tensor, optimizer: torch.optim.Optimizer) -> None:
    """A forward pass, a backward pass and a step."""
    optimizer.zero_grad(set_to_none=True)
    ((weights_of() - target) ** 2).sum(1).mean().backward()
    optimizer.step()
