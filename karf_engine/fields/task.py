"""What a fit of photos starts from, before it is known where it runs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch

from ..capture.capture import SparsePoints, View
from ..capture.training_images import TrainingImage, background_kind, solid_pixels
from ..compute import cores
from ..compute.runtime import Runtime
from ..project.settings import GeometrySettings
from .fit import Fit, FitInputs
from .registry import start_fit
from .rendering.rays import PixelDataset
from .spaces import choose_space


@dataclass(frozen=True)
class FitTask:
    """What each process of a group learns from: training images with cameras of their size, and more of `FitInputs`.

    seed: of all random numbers. threads: of each process. device: its kind; each process has a card of its own.
    """

    training_images: list[TrainingImage]
    kind: str
    space: str
    views: list[View]
    points: SparsePoints | None
    settings: GeometrySettings
    seed: int
    threads: int
    device: str

    def start(self, runtime: Runtime) -> Fit:
        """The fresh fit."""
        dataset = build_pixel_dataset(self.training_images, self.kind, runtime.device)
        return start_fit(FitInputs(dataset, self.kind, self.space, self.views, self.points, self.settings, runtime))


def task_of(
    views: list[View],
    training_images: list[TrainingImage],
    kind: str,
    points: SparsePoints | None,
    settings: GeometrySettings,
    seed: int,
    device: torch.device,
) -> FitTask:
    """The task of learning from images of these views, in the space that suits them, on this process's threads."""
    views = [
        replace(view, camera=training_image.camera) for view, training_image in zip(views, training_images, strict=True)
    ]
    space = choose_space(kind, views, points, settings)
    return FitTask(training_images, kind, space, views, points, settings, seed, cores.count(), device.type)


def background_of(training_images: list[TrainingImage]) -> str:
    """What the training images show behind the scene: alpha, black, white or opaque."""
    return background_kind([p.color if p.alpha is None else np.dstack([p.color, p.alpha]) for p in training_images])


def build_pixel_dataset(training_images: list[TrainingImage], kind: str, device: torch.device) -> PixelDataset:
    """All pixels of the training images, with the opacity that the kind of background implies."""
    alphas = solids = None
    if kind == "alpha":
        alphas = [
            np.ones(training_image.color.shape[:2]) if training_image.alpha is None else training_image.alpha
            for training_image in training_images
        ]
    if kind in ("black", "white"):
        solids = [solid_pixels(training_image.color, kind) for training_image in training_images]
    valid = None
    if any(training_image.valid is not None for training_image in training_images):
        valid = [np.ones(p.color.shape[:2], bool) if p.valid is None else p.valid for p in training_images]
    return PixelDataset(
        [p.camera for p in training_images], [p.color for p in training_images], alphas, solids, valid, device
    )
