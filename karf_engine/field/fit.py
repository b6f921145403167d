"""Fitting a voxel field to photos, coarse to fine: what fits in a box and fits of open space share.

What makes it fast: samples only in occupied cells, color only where a sample is seen, a fixed number of samples an
iteration.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torch import Tensor

from ..errors import Diverged
from ..progress import Progress
from ..rendering.rays import PixelBank
from ..rendering.volume import ray_weights_from_sigmas
from ..runtime import Runtime
from ..settings import GeometrySettings, Level, OpenSettings
from ..training import train, warm_exponential
from .scene import Scene
from .voxels import Background, VoxelField


@dataclass(frozen=True)
class Batch:
    """One step's result: the loss, the part of it that is the colors' mean squared error, the samples it took."""

    loss: Tensor
    error: Tensor
    n_samples: int


class Fit:
    """State of one fit: the field, what is behind it, and what they learn from. Subclasses say what the loss is.

    recipe: the levels with their rates and limits. cuts: shares of a level's iterations after which it is pruned again.
    first_share: of the samples that the first level takes: in its fog each of them is seen. kind: of background.
    """

    kind: str
    cuts: tuple[float, ...] = ()
    first_share = 1.0

    def __init__(
        self,
        bank: PixelBank,
        recipe: GeometrySettings | OpenSettings,
        runtime: Runtime,
        field: VoxelField,
        background: Background | None,
    ) -> None:
        self.bank, self.recipe, self.runtime = bank, recipe, runtime
        self.field, self.background = field, background
        self._rays_per_batch = 1024.0
        self._loss_average = 0.1

    @property
    def iterations(self) -> int:
        """Iterations of the whole fit."""
        return sum(level.iterations for level in self.recipe.levels)

    def scenes(self, progress: Progress) -> Iterator[Scene]:
        """Run the fit; the scene as it stands after each level."""
        for number, level in enumerate(self.recipe.levels):
            self.run_level(number, level, progress)
            yield Scene(self.field, self.background, self.kind, level.step)

    def run_level(self, number: int, level: Level, progress: Progress) -> None:
        """Train one level; the field is replaced by finer and pruned ones on the way."""
        if number > 0:
            self._prune()
            self.field = self.field.refined(level.voxels)
        self._begin(number, level)
        done = 0
        for part in [level.iterations] if number == 0 else _parts(level.iterations, self.cuts):
            if done:
                self._prune()
            self._train(number, level, done, part, progress)
            done += part

    def _begin(self, number: int, level: Level) -> None:
        """Called before the iterations of each level."""

    def _batch(self, number: int, level: Level, n_rays: int) -> Batch:
        raise NotImplementedError

    def _trained_networks(self) -> list:
        return list(self.field.color_network.parameters())

    def _train(self, number: int, level: Level, done: int, iterations: int, progress: Progress) -> None:
        field = self.field
        optimizer = torch.optim.Adam(
            [
                {"params": [field.raw_density, field.feature_table], "lr": self.recipe.table_rate},
                {"params": self._trained_networks(), "lr": self.recipe.network_rate},
            ],
            betas=(0.9, 0.99),
            eps=1e-12,
            fused=True,
        )
        whole = warm_exponential(10, 0.35, 0.1)

        def schedule(iteration: int, _: int) -> float:
            # a part after pruning warms up again, and goes on where the level's decay stood
            return min(1.0, (iteration + 1) / 10) * whole(max(done + iteration, 10), level.iterations)

        train(iterations, optimizer, lambda i, scale: self._step(number, level, scale), schedule, progress)

    def _step(self, number: int, level: Level, batch_scale: float) -> tuple[Tensor, dict[str, float]]:
        n_rays = max(64, int(self._rays_per_batch * batch_scale))
        batch = self._batch(number, level, n_rays)
        if batch.n_samples:
            share = self.first_share if number == 0 else 1.0
            wanted = n_rays * share * self.recipe.samples / batch.n_samples
            self._rays_per_batch = min(0.8 * self._rays_per_batch + 0.2 * wanted, self.recipe.max_rays)
        self._loss_average += 0.05 * (float(batch.error.detach()) - self._loss_average)
        return batch.loss, {"psnr": -10 * math.log10(max(self._loss_average, 1e-10))}

    @torch.no_grad()
    def _prune(self) -> None:
        """Keep cells that are dense enough and that some training ray sees."""
        field = self.field
        visibility = torch.zeros(field.occupied.numel(), device=self.runtime.device)
        for _ in range(16):
            index = self.bank.draw(8192, self.runtime)
            samples = field.march(self.bank.rays(index), 1.0)
            sigmas = field.density_at(*field.corners(samples.positions, all_occupied=True))
            weights = ray_weights_from_sigmas(sigmas, samples.step, samples.ray_indices)
            visibility.scatter_reduce_(0, field.cells(samples.positions), weights, "amax")
        keep = (field.cell_alphas() > self.recipe.prune_alpha) & (
            visibility[field.occupied.view(-1)] > self.recipe.prune_visibility
        )
        if not keep.any():
            raise Diverged(
                "The geometry stage found nothing solid in the scene.",
                "Check the camera poses, or raise the iterations.",
            )
        self.field = field.pruned(keep)


def _parts(iterations: int, cuts: tuple[float, ...]) -> list[int]:
    """Lengths of the stretches between the cuts (shares of the whole)."""
    marks = [0, *[int(iterations * cut) for cut in cuts], iterations]
    return [b - a for a, b in itertools.pairwise(marks) if b > a]
