"""What a fit of photos starts from, before it is known where it runs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch

from ..capture.capture import SparsePoints, View
from ..capture.training_images import Plate, background_kind, solid_pixels
from ..compute import cores
from ..compute.runtime import Runtime
from ..project.settings import GeometrySettings
from .fit import Fit, FitInputs
from .registry import start_fit
from .rendering.rays import PixelBank
from .spaces import choose_space


@dataclass(frozen=True)
class FitTask:
    """What each process of a team learns from: plates with cameras of their size, and what `FitInputs` has.

    seed: of all random numbers. threads: of each process. device: its kind; each process has a card of its own.
    """

    plates: list[Plate]
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
        bank = make_bank(self.plates, self.kind, runtime.device)
        return start_fit(FitInputs(bank, self.kind, self.space, self.views, self.points, self.settings, runtime))


def task_of(
    views: list[View],
    plates: list[Plate],
    kind: str,
    points: SparsePoints | None,
    settings: GeometrySettings,
    seed: int,
    device: torch.device,
) -> FitTask:
    """The task of learning from plates of these views, in the space that suits them, on as many threads as this process."""
    views = [replace(view, camera=plate.camera) for view, plate in zip(views, plates, strict=True)]
    space = choose_space(kind, views, points, settings)
    return FitTask(plates, kind, space, views, points, settings, seed, cores.count(), device.type)


def background_of(plates: list[Plate]) -> str:
    """What the plates show behind the scene: alpha, black, white or opaque."""
    return background_kind([p.color if p.alpha is None else np.dstack([p.color, p.alpha]) for p in plates])


def make_bank(plates: list[Plate], kind: str, device: torch.device) -> PixelBank:
    """All pixels of the plates, with what the kind of background says of their opacity."""
    alphas = solids = None
    if kind == "alpha":
        alphas = [np.ones(plate.color.shape[:2]) if plate.alpha is None else plate.alpha for plate in plates]
    if kind in ("black", "white"):
        solids = [solid_pixels(plate.color, kind) for plate in plates]
    valid = None
    if any(plate.valid is not None for plate in plates):
        valid = [np.ones(p.color.shape[:2], bool) if p.valid is None else p.valid for p in plates]
    return PixelBank([p.camera for p in plates], [p.color for p in plates], alphas, solids, valid, device)
