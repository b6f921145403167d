"""The base of all rules of layers: how they are learned, and how an edit of their palette recolors the test photos.

Every rule shows a point by a palette P [M, 3] and something that no swatch moves (offsets, shine), so that a change dP
of the palette moves the point's color by w dP; w [M] are its layers' weights there. As in ours the change is added to
the photo, sample by sample times the probability of F_s. What differs between the rules is w and P.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from karf_engine.fields.training import Adam
from karf_engine.heads.rendering import ObjectSamples
from karf_engine.palettes.color_histogram import color_cells
from karf_engine.palettes.extraction import extract_palette
from karf_engine.palettes.matching.becomes import match_becomes
from karf_engine.recolor.frames import Frame

from .points import ObjectPoints

SOLVED_ON = 20_000  # points that an edit is solved on


@dataclass(frozen=True)
class Training:
    """How long and how fast a rule is learned. The papers take 3000 to 30000 iterations of 4096 rays, rate 0.01 to 0.02,
    of a field that starts from nothing; here only the layers are learned, on a field that is there.
    """

    iterations: int = 400
    batch: int = 1024
    rate: float = 0.01
    palette_rate: float = 0.002


class Layers(nn.Module):
    """A rule of layers for one object.

    Attributes:
        palette: [M, 3] sRGB, learned.
    """

    palette: nn.Parameter

    @abstractmethod
    def weights(self, positions: Tensor, features: Tensor, viewdirs: Tensor) -> Tensor:
        """Return how far each palette color moves the color of each point, [n, M]."""

    @abstractmethod
    def loss(self, index: Tensor, done: float) -> Tensor:
        """Of a batch of the object's points, by their numbers; done: share of the training so far, in [0, 1)."""


def learn(layers: Layers, n_points: int, training: Training, random: torch.Generator) -> None:
    """Learn the layers of an object, in place, by Adam with a rate that falls to a tenth."""
    others = [parameter for parameter in layers.parameters() if parameter is not layers.palette]
    optimizer = Adam(
        [{"params": others, "lr": training.rate}, {"params": [layers.palette], "lr": training.palette_rate}]
    )
    rates = [group["lr"] for group in optimizer.param_groups]
    for iteration in range(training.iterations):
        done = iteration / training.iterations
        for group, rate in zip(optimizer.param_groups, rates, strict=True):
            group["lr"] = rate * 0.1**done
        index = torch.randint(n_points, (training.batch,), generator=random)
        optimizer.zero_grad()
        layers.loss(index, done).backward()
        optimizer.step()
    layers.requires_grad_(False)


def hull_palette(points: ObjectPoints, tolerance: float) -> np.ndarray:
    """Return our own initial palette, [M, 3] with black first: the rules get as many colors as we do."""
    return extract_palette(*color_cells(points.colors.numpy()), tolerance=tolerance)


@torch.no_grad()
def edited_palette(layers: Layers, points: ObjectPoints, source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """The palette [M, 3] with which the source's paint becomes the target's: our own solver, on the rule's weights.

    The papers leave it to the artist to drag single swatches. The one solver for all keeps the judge out of it.
    """
    some = points[torch.arange(0, len(points), len(points) // SOLVED_ON + 1)]
    weights = layers.weights(some.positions, some.features, some.viewdirs).numpy()
    colors, palette = some.colors.numpy(), layers.palette.clamp(0, 1).numpy()
    # the solver keeps its first entry: a black that no point has
    weights, held = np.pad(weights, ((0, 0), (1, 0))), np.pad(palette, ((1, 0), (0, 0)))
    edited = match_becomes(colors, np.ones(len(colors)), weights, held, source, target)[1:]
    return layers.palette.numpy() + edited - palette


@torch.no_grad()
def recolored(
    frame: Frame, samples: ObjectSamples, layers: dict[int, Layers], edited: dict[int, np.ndarray]
) -> np.ndarray:
    """The frame's photo [H, W, 3] with edited palettes of some objects.

    Args:
        frame: Its base is the photo.
        samples: Where objects are along its rays.
        layers: Of the edited objects, by their numbers.
        edited: Their palettes.
    """
    cache = frame.picture.cache
    moves = torch.zeros(len(cache), 3)
    for number, rule in layers.items():
        share = samples.classes[:, number]
        own = torch.nonzero(share > 0).squeeze(1)
        weights = rule.weights(samples.positions[own], samples.features[own], samples.viewdirs[own])
        change = weights @ torch.from_numpy(edited[number]).float().sub(rule.palette)
        moves.index_add_(0, samples.rays[own], change * (share[own] * samples.counts[own])[:, None])
    moves *= (cache.opacity / cache.positions.shape[1])[:, None]
    picture = frame.base.copy()
    picture.reshape(-1, 3)[cache.index.numpy()] += moves.numpy()
    return np.clip(picture, 0, 1)
