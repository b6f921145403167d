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
    """Inputs of a fit.

    Attributes:
        dataset: All pixels of the training photos.
        background_kind: alpha, black, white or opaque; the background of the photos.
        space: box, contraction or frustum (see spaces.py).
        views: Of the dataset, with cameras of its image sizes.
        points: Sparse points as observed by these views, or None.
        settings: Of the geometry stage.
        runtime: Device and only source of random numbers.
    """

    dataset: PixelDataset
    background_kind: str
    space: str
    views: list[View]
    points: SparsePoints | None
    settings: GeometrySettings
    runtime: Runtime


class Fit(Resumable, Protocol):
    """A fit of one scene, fresh or resumed."""

    def scenes(self, progress: Progress, checkpoint: Checkpoint | None = None) -> Iterator[Scene]:
        """Run the rest of the fit; yield the scene at intervals and at the end.

        Each iteration calls `progress.step` and offers itself to `checkpoint`, as `fields.training.loop.train` does.
        """
        ...
