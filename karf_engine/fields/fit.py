"""What a fit of a radiance field starts from, and what it is to the geometry stage."""

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
    """What a fit starts from.

    Attributes:
        dataset: All pixels of the training photos.
        background_kind: alpha, black, white or opaque: what the photos show behind the scene.
        space: box, contraction or frustum (see spaces.py): what suits the capture, or was asked for.
        views: Of the dataset, with cameras of its pictures' size.
        points: Sparse points as these views observe them, or None.
        settings: Of the geometry stage.
        runtime: Where to compute, and the only source of random numbers.
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
        """Run what is left of the fit; yields the scene as it stands from time to time, and at the end.

        Each iteration is one `progress.step`, and is offered to `checkpoint`: `fields.training.loop.train` does both.
        """
