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

from ...compute.progress import Progress
from ...compute.runtime import Runtime
from ...errors import DataError, Diverged
from ...project.settings import GeometrySettings, Level, OpenSettings
from ..background import Background
from ..exposures import photo_gains
from ..rendering.rays import PixelDataset, Rays
from ..scene import Scene
from ..training.checkpoint import Checkpoint
from ..training.loop import exponential_with_warmup, train
from ..training.state import TrainingState, below, check_alike, number, prefixed, whole_number
from .choice import new_renderer
from .field import VoxelField
from .renderer import PointSupervision, Renderer

POINT_MARGIN = 2.0  # voxels; a point's surface is looked for this far round it
BATCH_RAYS, FEWEST_BATCHES = 8192, 16  # that tell what training rays see
RAYS_PER_CELL = 0.25  # for pruning: with fewer, fine cells that few photos show are missed by chance, and leave holes
PRUNED_AT = 256  # cells along the longest side, for which the limits of visibility are meant, and all coarser grids
COMPARED_AFTER = 1  # number of the level after which photos' exposures are compared: its geometry is fine enough
OFF_PATH = 3.0  # voxels; an observation whose point lies farther from its own ray is a mistake


@dataclass(frozen=True)
class Batch:
    """One step's result: the loss, the part of it that is the colors' mean squared error, the samples it took."""

    loss: Tensor
    error: Tensor
    n_samples: int


@dataclass(frozen=True)
class Part:
    """A stretch of a level's iterations: the level's number, its iterations before this part, and those of the part."""

    level: int
    before: int
    iterations: int


class VoxelFit:
    """A `Fit` (see fields/fit.py): the field, what is behind it, and what they learn from. Subclasses define the loss.

    Attributes:
        background_kind: alpha, black, white or opaque.
        cuts: Shares of a level's iterations after which it is pruned again.
        first_share: Of the samples that the first level takes: in its fog each of them is seen.
        russian_roulette: Samples of less weight get a color with a probability in proportion to it; 0 for none.
        recipe: The levels with their rates and limits.
    """

    background_kind: str
    cuts: tuple[float, ...] = ()
    first_share = 1.0
    russian_roulette = 0.0

    def __init__(
        self,
        dataset: PixelDataset,
        recipe: GeometrySettings | OpenSettings,
        runtime: Runtime,
        field: VoxelField,
        background: Background | None,
    ) -> None:
        self.dataset, self.recipe, self.runtime = dataset, recipe, runtime
        self.field, self.background = field, background
        self._rays_per_batch = min(1024.0, recipe.max_rays)
        self._loss_average = torch.tensor(0.1, dtype=torch.float64, device=runtime.device)
        self._parts = [part for level in range(len(recipe.levels)) for part in self._parts_of(level)]
        self._number = 0  # of the part that is being learned
        self._training_state: TrainingState | None = None  # of that part, once it has begun
        self._renderer: Renderer | None = None  # of the field, likewise
        self._unit = float((field.bounds[1] - field.bounds[0]).max()) / 2  # of distances along rays

    @property
    def iterations(self) -> int:
        """Iterations of the whole fit."""
        return sum(level.iterations for level in self.recipe.levels)

    @property
    def done(self) -> int:
        """Iterations that are done."""
        return sum(part.iterations for part in self._parts[: self._number]) + (
            self._training_state.done if self._training_state else 0
        )

    @property
    def gains(self) -> list[list[float]]:
        """How each photo is exposed beside the others, red, green and blue; 1 where that is not told."""
        return self.dataset.gains.tolist()

    def scenes(self, progress: Progress, checkpoint: Checkpoint | None = None) -> Iterator[Scene]:
        """Run what is left of the fit; the scene as it stands after each level, frozen."""
        if self._training_state is None:
            self._begin(self._parts[0])
        for part in self._parts[self._number :]:
            if part is not self._parts[self._number]:
                self._number += 1
                self._begin(part)
            self._train(part, progress, checkpoint)
            level = self.recipe.levels[part.level]
            if part.before + part.iterations == level.iterations:
                frozen = self.field.requires_grad_(False)  # each part learns a field of its own
                scene = Scene(frozen, self.background, self.background_kind, level.step)
                if part.level == COMPARED_AFTER < len(self.recipe.levels) - 1 and self.background_kind == "opaque":
                    self.dataset.gains.copy_(torch.from_numpy(photo_gains(scene, self.dataset)))
                yield scene

    def state(self) -> dict[str, Tensor]:
        """All that resuming takes, once the fit has begun."""
        return (
            self._position() | prefixed("own", self._own_tensors()) | prefixed("course", self._training_state.state())
        )

    def resume(self, state: dict[str, Tensor]) -> None:
        """Let this fresh fit resume a state, on the processor, of a fit of the same photos and settings.

        Raises:
            DataError: The state is of another fit; nothing is changed then.
        """
        saved_state = below("course", state)
        own = {name: tensor for name, tensor in state.items() if not name.startswith("course.")}
        check_alike(own, self._position() | prefixed("own", self._own_tensors()))
        number_of_part = whole_number(state, "part", len(self._parts) - 1)
        field = self._field_like(below("learned.field", saved_state), float(state["voxel"]))
        renderer = self._renderer_of(field)
        training_state = self._course_of(field, renderer, self._parts[number_of_part])
        training_state.resume(saved_state)
        self._number = number_of_part
        self._rays_per_batch = float(state["rays_per_batch"])
        self._loss_average = state["loss_average"].to(self.runtime.device)
        for name, tensor in self._own_tensors().items():
            tensor.copy_(state[f"own.{name}"])
        self._learn(field, renderer, training_state)

    def _position(self) -> dict[str, Tensor]:
        """The numbers of a state."""
        return {
            "voxel": number(self.field.voxel),
            "part": number(self._number),
            "rays_per_batch": number(self._rays_per_batch),
            "loss_average": self._loss_average.detach().cpu(),
        }

    def _own_tensors(self) -> dict[str, Tensor]:
        """What is known beside the field and the background, of shapes that never change."""
        return {"gains": self.dataset.gains}

    def _field_like(self, tensors: dict[str, Tensor], voxel: float) -> VoxelField:
        """A field like the present one in the cells of a state, its values not yet filled in."""
        occupied, like = tensors.get("occupied"), self.field
        if occupied is None or occupied.dtype != torch.bool or occupied.dim() != 3 or not occupied.any() or voxel <= 0:
            raise DataError("What was learned holds no occupied cells.")
        occupied = occupied.to(self.runtime.device)
        minimum = like.minimum.clone()
        return VoxelField(minimum, voxel, occupied, like.n_features, like.width, like.density_bias, like.space)

    def _begin(self, part: Part) -> None:
        """Prune before every part but the first, and refine before every level but the first."""
        if part is not self._parts[0]:
            self._training_state = None  # its memory is needed
            self.field = self._pruned()
            self._renderer = None  # likewise
        if part.level and not part.before:
            self.field = self._refined(self.recipe.levels[part.level])
        renderer = self._renderer_of(self.field)
        self._learn(self.field, renderer, self._course_of(self.field, renderer, part))
        if part.level and not part.before:
            self._begin_level(self.recipe.levels[part.level])

    def _refined(self, level: Level) -> VoxelField:
        """The field in the cells of a level."""
        return self.field.refined(level.voxels)

    def _begin_level(self, level: Level) -> None:
        """Called before the iterations of each level but the first, on its field."""

    def _learn(self, field: VoxelField, renderer: Renderer, training_state: TrainingState) -> None:
        """Train this field from now on."""
        self.field, self._renderer, self._training_state = field, renderer, training_state

    def _renderer_of(self, field: VoxelField) -> Renderer:
        supervision = PointSupervision(POINT_MARGIN * field.voxel, OFF_PATH * field.voxel)
        return new_renderer(field, self.runtime, self._unit, self.russian_roulette, supervision)

    def _batch(self, number: int, level: Level, n_rays: int) -> Batch:
        raise NotImplementedError

    def _trained_networks(self, field: VoxelField) -> list:
        return list(field.color_network.parameters())

    def _course_of(self, field: VoxelField, renderer: Renderer, part: Part) -> TrainingState:
        groups = [
            {"params": [field.raw_density, field.feature_table], "lr": self.recipe.table_rate},
            {"params": self._trained_networks(field), "lr": self.recipe.network_rate},
        ]
        optimizer = renderer.optimizer(groups, betas=(0.9, 0.99))
        return TrainingState(part.iterations, optimizer, lambda: self._learned(field), self.runtime)

    def _learned(self, field: VoxelField) -> dict[str, Tensor]:
        background = {} if self.background is None else self.background.state_dict()
        return prefixed("field", field.state_dict()) | prefixed("background", background)

    def _train(self, part: Part, progress: Progress, checkpoint: Checkpoint | None) -> None:
        level = self.recipe.levels[part.level]
        whole = exponential_with_warmup(10, 0.35, 0.1)

        def schedule(iteration: int, _: int) -> float:
            # a part after pruning warms up again, and resumes the level's decay where it stood
            return min(1.0, (iteration + 1) / 10) * whole(max(part.before + iteration, 10), level.iterations)

        def step(_: int, batch_scale: float) -> tuple[Tensor, dict[str, float]]:
            return self._step(part.level, level, batch_scale)

        train(self._training_state, part.iterations, step, schedule, progress, checkpoint)

    def _step(self, number: int, level: Level, batch_scale: float) -> tuple[Tensor, dict[str, float]]:
        n_rays = max(64, int(self._rays_per_batch * batch_scale))
        batch = self._batch(number, level, n_rays)
        if batch.n_samples:
            share = self.first_share if number == 0 else 1.0
            wanted = n_rays * share * self.recipe.samples / batch.n_samples
            self._rays_per_batch = min(0.8 * self._rays_per_batch + 0.2 * wanted, self.recipe.max_rays)
        # stays a tensor: reading it would wait for the device
        self._loss_average = torch.lerp(self._loss_average, batch.error.detach().double(), 0.05)
        return batch.loss, {"psnr": -10 * self._loss_average.clamp_min(1e-10).log10()}

    @torch.no_grad()
    def _pruned(self) -> VoxelField:
        """The field with only the cells that are dense enough and that some training ray sees."""
        field = self.field
        visibility = self._renderer.visibility(self._some_rays(RAYS_PER_CELL * float(field.occupied.sum())))
        # the thinner a cell, the less any one of a fog weighs
        least = self.recipe.prune_visibility * min(1.0, PRUNED_AT / max(field.occupied.shape))
        keep = (field.cell_alphas() > self.recipe.prune_alpha) & (visibility > least)
        if not keep.any():
            raise Diverged(
                "The geometry stage found nothing solid in the scene.",
                "Check the camera poses, or raise the iterations.",
            )
        return field.pruned(keep)

    def _some_rays(self, at_least: float = 0.0) -> Iterator[Rays]:
        """Batches of rays through random pixels, that tell what training rays see; so many rays at least."""
        n_batches = max(FEWEST_BATCHES, math.ceil(at_least / BATCH_RAYS))
        return (self.dataset.rays(self.dataset.draw(BATCH_RAYS, self.runtime)) for _ in range(n_batches))

    def _parts_of(self, level: int) -> list[Part]:
        """The stretches between the cuts of a level; the first level has none."""
        iterations = self.recipe.levels[level].iterations
        cuts = [0, *[int(iterations * cut) for cut in (self.cuts if level else ())], iterations]
        return [Part(level, a, b - a) for a, b in itertools.pairwise(cuts) if b > a]
