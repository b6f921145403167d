"""The task of fitting a field to photos, independent of device and process."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch

from ..capture.capture import SparsePoints, View
from ..capture.training_images import TrainingImage, background_kind, solid_pixels
from ..compute import cores
from ..compute.runtime import Runtime
from ..project.settings import GeometrySettings
from .extent import choose_space
from .fit import Fit, FitInputs
from .registry import start_fit
from .rendering.rays import PixelDataset


@dataclass(frozen=True)
class FitTask:
    """All that each process of a group needs to begin the same fit; more of its attributes are in `FitInputs`."""

    training_images: list[TrainingImage]  # with cameras of their sizes
    kind: str  # background of the photos
    space: str
    views: list[View]
    points: SparsePoints | None
    settings: GeometrySettings
    seed: int  # of all random numbers
    threads: int  # of each process
    device: str  # type of device

    def start(self, runtime: Runtime) -> Fit:
        """Begin the fit on this process's device."""
        dataset = build_pixel_dataset(self.training_images, self.kind, runtime.device)
        return start_fit(FitInputs(dataset, self.kind, self.space, self.views, self.points, self.settings, runtime))


def make_fit_task(
    views: list[View],
    training_images: list[TrainingImage],
    kind: str,
    points: SparsePoints | None,
    settings: GeometrySettings,
    seed: int,
    device: torch.device,
) -> FitTask:
    """Build the task of fitting these views, in the space that suits them, with this process's threads."""
    views = [replace(view, camera=image.camera) for view, image in zip(views, training_images, strict=True)]
    space = choose_space(kind, views, points, settings)
    return FitTask(training_images, kind, space, views, points, settings, seed, cores.core_count(), device.type)


def background_kind_of(training_images: list[TrainingImage]) -> str:
    """Return the background of the training images: alpha, black, white or opaque."""
    return background_kind(
        [image.color if image.alpha is None else np.dstack([image.color, image.alpha]) for image in training_images]
    )


def build_pixel_dataset(training_images: list[TrainingImage], kind: str, device: torch.device) -> PixelDataset:
    """Build the dataset of the training images, with the opacity that the kind of background implies."""
    alphas = solids = valid = None
    if kind == "alpha":
        alphas = [np.ones(image.color.shape[:2]) if image.alpha is None else image.alpha for image in training_images]
    if kind in ("black", "white"):
        solids = [solid_pixels(image.color, kind) for image in training_images]
    if any(image.valid is not None for image in training_images):
        valid = [
            np.ones(image.color.shape[:2], bool) if image.valid is None else image.valid for image in training_images
        ]
    cameras, colors = [image.camera for image in training_images], [image.color for image in training_images]
    return PixelDataset(cameras, colors, alphas, solids, valid, device)
