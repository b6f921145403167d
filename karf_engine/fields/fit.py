"""The fit of a radiance field to photos: its inputs and its protocol."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

from ..capture.capture import SparsePoints, View
from ..compute.progress import Progress
from ..compute.runtime import Runtime
from ..project.settings import GeometrySettings
from .rendering.rays import PixelDataset
from .scene import Scene
from .training.checkpoint import Checkpoint, Resumable


@dataclass(frozen=True)
class FitInputs:
    """Inputs of a fit."""

    dataset: PixelDataset  # all pixels of the training photos
    background_kind: str  # alpha, black, white or opaque; the background of the photos
    space: str  # box, contraction or frustum (see extent.py)
    views: list[View]  # of the dataset, with cameras of its image sizes
    points: SparsePoints | None  # sparse points as observed by these views, or None
    settings: GeometrySettings  # of the geometry stage
    runtime: Runtime  # device and only source of random numbers


class Fit(Resumable, Protocol):
    """A fit of one scene, fresh or resumed."""

    def scenes(self, progress: Progress, checkpoint: Checkpoint | None = None) -> Iterator[Scene]:
        """Run the rest of the fit; yield the scene at intervals and at the end.

        Each iteration calls `progress.step` and offers itself to `checkpoint`, as `fields.training.loop.train` does.
        """
        ...
