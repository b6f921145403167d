"""Coarse-to-fine training of a voxel field on photos: common to fits in a box and in open space.

Samples are taken only in occupied cells, colors are computed only for visible samples, and the number of rays is
adapted so that each iteration takes about the same number of samples.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import torch
from torch import Tensor

from ...compute.precision import float64_device, to_float64
from ...compute.progress import Progress
from ...compute.runtime import Runtime
from ...errors import DataError, Diverged
from ...project.settings import GeometrySettings, Level, OpenSettings
from ..exposures import estimate_photo_gains
from ..fit import Checkpoint
from ..rendering.rays import PixelDataset, Rays
from ..scene import Background, Scene
from ..training import (
    TrainingState,
    add_prefix,
    check_same_layout,
    exponential_with_warmup,
    read_integer,
    scalar_tensor,
    strip_prefix,
    train,
)
from .field import VoxelField
from .renderer import Renderer
from .torch_renderer import new_renderer

POINT_MARGIN = 2.0  # voxels between an observed point and its surface
OFF_PATH = 3.0  # voxels between an observed point and its ray, beyond which it is an outlier
BATCH_RAYS, FEWEST_BATCHES = 8192, 16  # rays that measure visibility
RAYS_PER_CELL = 0.25  # for pruning: fewer rays miss fine cells and leave holes
PRUNED_AT = 256  # cells along the longest side; finer grids scale the visibility limit down
COMPARED_AFTER = 1  # level after which the exposures of photos are compared

Recipe = TypeVar("Recipe", GeometrySettings, OpenSettings)


@dataclass(frozen=True)
class Phase:
    """Part of a level between two prunings."""

    level: int  # number of the level
    before: int  # iterations of the level before this phase
    iterations: int


class VoxelFit(Generic[Recipe]):
    """`Fit` (see fields/fit.py) of a voxel field and its background. Subclasses define the loss."""

    background_kind: str  # alpha, black, white or opaque
    cuts: tuple[float, ...] = ()  # fractions of a level's iterations before another pruning
    first_share = 1.0  # factor of the samples per iteration in the first level, whose fog needs a color for each sample
    russian_roulette = 0.0  # see `new_renderer`

    def __init__(
        self, dataset: PixelDataset, recipe: Recipe, runtime: Runtime, field: VoxelField, background: Background | None
    ) -> None:
        self.dataset, self.recipe, self.runtime = dataset, recipe, runtime
        self.field, self.background = field, background
        self._rays_per_batch = min(1024.0, recipe.max_rays)
        self._loss_average = scalar_tensor(0.1).to(float64_device(runtime.device))
        self._phases = [phase for level in range(len(recipe.levels)) for phase in self._phases_of(level)]
        self._number = 0  # of the current phase
        self._training_state: TrainingState | None = None  # of the current phase, once it has begun
        self.renderer: Renderer  # of the current phase
        self._unit = float((field.bounds[1] - field.bounds[0]).max()) / 2  # of distances along rays

    @property
    def iterations(self) -> int:
        """Iterations of the whole fit."""
        return sum(level.iterations for level in self.recipe.levels)

    @property
    def done(self) -> int:
        """Completed iterations."""
        finished = sum(phase.iterations for phase in self._phases[: self._number])
        return finished + (self._training_state.done if self._training_state else 0)

    @property
    def gains(self) -> list[list[float]]:
        """Exposure gains of each photo, red, green and blue; 1 where unknown."""
        return self.dataset.gains.tolist()

    def scenes(self, progress: Progress, checkpoint: Checkpoint | None = None) -> Iterator[Scene]:
        """Run the remaining iterations; yield the frozen scene after each level."""
        if self._training_state is None:
            self._begin(self._phases[0])
        for phase in self._phases[self._number :]:
            if phase is not self._phases[self._number]:
                self._number += 1
                self._begin(phase)
            self._train(phase, progress, checkpoint)
            level = self.recipe.levels[phase.level]
            if phase.before + phase.iterations == level.iterations:
                frozen = self.field.requires_grad_(False)  # the next phase trains another field
                scene = Scene(frozen, self.background, self.background_kind, level.step)
                if phase.level == COMPARED_AFTER < len(self.recipe.levels) - 1 and self.background_kind == "opaque":
                    self.dataset.gains.copy_(torch.from_numpy(estimate_photo_gains(scene, self.dataset)))
                yield scene

    def state(self) -> dict[str, Tensor]:
        """Return the tensors to resume from. Requires a fit that has begun."""
        assert self._training_state is not None
        return self._own_state() | add_prefix("course", self._training_state.state())

    def resume(self, state: dict[str, Tensor]) -> None:
        """Resume this new fit from a state on the processor, saved with the same photos and settings.

        Raises:
            DataError: The state is of another fit; nothing is changed then.
        """
        saved_state = strip_prefix("course", state)
        own = {name: tensor for name, tensor in state.items() if not name.startswith("course.")}
        check_same_layout(own, self._own_state())
        phase_number = read_integer(state, "part", len(self._phases) - 1)
        field = self._field_like(strip_prefix("learned.field", saved_state), float(state["voxel"]))
        renderer = self._new_renderer(field)
        training_state = self._new_training_state(field, renderer, self._phases[phase_number])
        training_state.resume(saved_state)
        self._number = phase_number
        self._rays_per_batch = float(state["rays_per_batch"])
        self._loss_average = state["loss_average"].to(self._loss_average.device)
        for name, tensor in self._own_tensors().items():
            tensor.copy_(state[f"own.{name}"])
        self._set_field(field, renderer, training_state)

    def _own_state(self) -> dict[str, Tensor]:
        return {
            "voxel": scalar_tensor(self.field.voxel),
            "part": scalar_tensor(self._number),
            "rays_per_batch": scalar_tensor(self._rays_per_batch),
            "loss_average": self._loss_average.detach().cpu(),
        } | add_prefix("own", self._own_tensors())

    def _own_tensors(self) -> dict[str, Tensor]:
        """Return the tensors of constant shape beside field and background."""
        return {"gains": self.dataset.gains}

    def _field_like(self, tensors: dict[str, Tensor], voxel: float) -> VoxelField:
        """Return an empty field with the occupied cells of a saved one."""
        occupied = tensors.get("occupied")
        if occupied is None or occupied.dtype != torch.bool or occupied.dim() != 3 or not occupied.any() or voxel <= 0:
            raise DataError("What was learned holds no occupied cells.")
        return self.field.with_cells(self.field.minimum.clone(), voxel, occupied.to(self.runtime.device))

    def _begin(self, phase: Phase) -> None:
        """Prune before all phases but the first, and refine before all levels but the first."""
        if phase is not self._phases[0]:
            self._training_state = None  # frees its memory
            self.field = self._pruned()
            del self.renderer
        begins_level = phase.level > 0 and not phase.before
        if begins_level:
            self.field = self._refined(self.recipe.levels[phase.level])
        renderer = self._new_renderer(self.field)
        self._set_field(self.field, renderer, self._new_training_state(self.field, renderer, phase))
        if begins_level:
            self._begin_level(self.recipe.levels[phase.level])

    def _refined(self, level: Level) -> VoxelField:
        return self.field.refined(level.voxels)

    def _begin_level(self, level: Level) -> None:
        """Hook before the iterations of all levels but the first."""

    def _set_field(self, field: VoxelField, renderer: Renderer, training_state: TrainingState) -> None:
        self.field, self.renderer, self._training_state = field, renderer, training_state

    def _new_renderer(self, field: VoxelField) -> Renderer:
        margin, off_path = POINT_MARGIN * field.voxel, OFF_PATH * field.voxel
        return new_renderer(field, self.runtime, self._unit, self.russian_roulette, margin, off_path)

    def _losses(self, number: int, level: Level, n_rays: int) -> tuple[Tensor, Tensor, int]:
        """Return total loss, mean squared color error and number of samples of random rays in a level."""
        raise NotImplementedError

    def _new_training_state(self, field: VoxelField, renderer: Renderer, phase: Phase) -> TrainingState:
        background = self.background
        trained = [] if background is None else [each for each in background.parameters() if each.requires_grad]
        groups = [
            {"params": [field.raw_density, field.feature_table], "lr": self.recipe.table_rate},
            {"params": [*field.color_network.parameters(), *trained], "lr": self.recipe.network_rate},
        ]
        optimizer = renderer.optimizer(groups, betas=(0.9, 0.99))

        def learned() -> dict[str, Tensor]:  # refers to no fit: a cycle would outlive it with all its data
            behind = {} if background is None else background.state_dict()
            return add_prefix("field", field.state_dict()) | add_prefix("background", behind)

        return TrainingState(phase.iterations, optimizer, learned, self.runtime)

    def _train(self, phase: Phase, progress: Progress, checkpoint: Checkpoint | None) -> None:
        level = self.recipe.levels[phase.level]
        of_level = exponential_with_warmup(10, 0.35, 0.1)

        def schedule(iteration: int, _: int) -> float:
            # warms up again after each pruning, and continues the decay of the level
            return min(1.0, (iteration + 1) / 10) * of_level(max(phase.before + iteration, 10), level.iterations)

        def step(_: int, batch_scale: float) -> tuple[Tensor, dict[str, Any]]:
            n_rays = max(64, int(self._rays_per_batch * batch_scale))
            loss, error, n_samples = self._losses(phase.level, level, n_rays)
            if n_samples:
                share = self.first_share if phase.level == 0 else 1.0
                wanted = n_rays * share * self.recipe.samples / n_samples
                self._rays_per_batch = min(0.8 * self._rays_per_batch + 0.2 * wanted, self.recipe.max_rays)
            # stays a tensor: reading the value would synchronize with the device
            self._loss_average = torch.lerp(self._loss_average, to_float64(error.detach()), 0.05)
            return loss, {"psnr": -10 * self._loss_average.clamp_min(1e-10).log10()}

        assert self._training_state is not None
        train(self._training_state, phase.iterations, step, schedule, progress, checkpoint)

    @torch.no_grad()
    def _pruned(self) -> VoxelField:
        """Return the field without cells that are nearly transparent or that no training ray sees."""
        field = self.field
        visibility = self.renderer.visibility(self._random_rays(RAYS_PER_CELL * float(field.occupied.sum())))
        # the thinner a cell of the same fog, the smaller its weight
        least = self.recipe.prune_visibility * min(1.0, PRUNED_AT / max(field.occupied.shape))
        keep = (field.cell_alphas() > self.recipe.prune_alpha) & (visibility > least)
        if not keep.any():
            raise Diverged(
                "The geometry stage found nothing solid in the scene.",
                "Check the camera poses, or raise the iterations.",
            )
        return field.pruned(keep)

    def _random_rays(self, at_least: float = 0.0) -> Iterator[Rays]:
        """Yield batches of rays through random pixels, at least this many rays in all."""
        n_batches = max(FEWEST_BATCHES, math.ceil(at_least / BATCH_RAYS))
        return (self.dataset.rays(self.dataset.draw(BATCH_RAYS, self.runtime)) for _ in range(n_batches))

    def _phases_of(self, level: int) -> list[Phase]:
        """Split a level at its cuts; the first level has none."""
        iterations = self.recipe.levels[level].iterations
        cuts = [0, *[int(iterations * cut) for cut in (self.cuts if level else ())], iterations]
        return [Phase(level, a, b - a) for a, b in itertools.pairwise(cuts) if b > a]
