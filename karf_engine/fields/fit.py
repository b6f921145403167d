"""The fit of a radiance field to photos: its inputs, its protocol, and its checkpoint on disk."""

from __future__ import annotations

import json
import time
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from safetensors import SafetensorError
from torch import Tensor

from ..capture.capture import SparsePoints, View
from ..compute.progress import Emit, Progress
from ..compute.runtime import Runtime
from ..errors import Cancelled, DataError, KarfError
from ..io.checkpoints import load_tensors, save_tensors
from ..project.settings import GeometrySettings
from .rendering.rays import PixelDataset
from .scene import Scene

CHECKPOINT_SCHEMA = "karf-unfinished/1"
CHECKPOINT_INTERVAL = 30.0  # seconds between saves, the most that a killed job loses


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


class Resumable(Protocol):
    """A fit that can be interrupted."""

    @property
    def iterations(self) -> int: ...  # iterations of the whole fit
    @property
    def done(self) -> int: ...  # iterations done so far

    def state(self) -> dict[str, Tensor]:
        """Return all tensors needed to resume."""
        ...

    def resume(self, state: dict[str, Tensor]) -> None:
        """Resume a state on the CPU in this fresh fit of the same inputs.

        On the same device the result equals that of an uninterrupted fit, bit for bit.

        Raises:
            DataError: The state is of another fit. Nothing is changed then.
        """
        ...


class Fit(Resumable, Protocol):
    """A fit of one scene, fresh or resumed."""

    def scenes(self, progress: Progress, checkpoint: Checkpoint | None = None) -> Iterator[Scene]:
        """Run the rest of the fit; yield the scene at intervals and at the end.

        Each iteration calls `progress.step` and offers itself to `checkpoint`, as `training.train` does.
        """
        ...


class Checkpoint:
    """The checkpoint file of one stage, from which a cancelled or killed fit resumes."""

    def __init__(self, path: Path, fingerprint: str, stage: str, emit: Emit) -> None:
        """Set up a checkpoint of a stage; the file is not read yet. A state with another fingerprint is not resumed."""
        self.notes: dict[str, Any] = {}  # JSON values stored with the fit, and restored when it resumes
        self._path, self._fingerprint, self._stage, self._emit = path, fingerprint, stage, emit
        self._fit: Resumable | None = None
        self._due = time.monotonic() + CHECKPOINT_INTERVAL
        self._is_writable = True

    def attach(self, fit: Resumable, progress: Progress) -> None:
        """Resume a fresh fit from the file, if there is one for the same inputs, and save this fit from now on.

        A damaged file is deleted with a warning.
        """
        self._fit = fit
        if not self._path.exists():
            return
        try:
            self._resume(fit)
        except DataError as error:
            self.delete()
            self._warn(f"Learning begins anew: {error.sentence}")
        if fit.done:
            progress.resume_at(fit.done)
            self._emit("stage", name=self._stage, text=f"resuming at iteration {fit.done} of {fit.iterations}")

    def _resume(self, fit: Resumable) -> None:
        state, metadata = load_tensors(self._path, CHECKPOINT_SCHEMA)
        try:
            fingerprint, notes, checksum = metadata["fingerprint"], metadata["notes"], metadata["checksum"]
        except (KeyError, TypeError) as error:
            raise DataError(f"{self._path} does not say what it belongs to.") from error
        if fingerprint != self._fingerprint:
            return
        if checksum != _checksum(state, notes):
            raise DataError(f"{self._path} is damaged (its checksum is another).")
        fit.resume(state)
        self.notes = notes

    def save_if_due(self) -> None:
        """Save if the last save is CHECKPOINT_INTERVAL ago."""
        if time.monotonic() >= self._due:
            self.save()

    def save(self) -> None:
        """Save the fit. A write error is only a warning, once."""
        assert self._fit is not None
        state = {name: tensor.detach().cpu().contiguous() for name, tensor in self._fit.state().items()}
        checksum = _checksum(state, self.notes)
        metadata = {"fingerprint": self._fingerprint, "notes": self.notes, "checksum": checksum}
        try:
            save_tensors(self._path, state, CHECKPOINT_SCHEMA, metadata)
        except (OSError, SafetensorError, KarfError) as error:
            if self._is_writable:
                self._warn(f"What is learned cannot be saved on the way, so that a killed job starts anew: {error}.")
            self._is_writable = False
        self._due = time.monotonic() + CHECKPOINT_INTERVAL

    def delete(self) -> None:
        """Delete the file."""
        self._path.unlink(missing_ok=True)

    def _warn(self, sentence: str) -> None:
        self._emit("warning", code="unfinished", sentence=sentence)


def _checksum(state: dict[str, Tensor], notes: dict[str, Any]) -> int:
    """Return the CRC-32 of notes and tensors, in the order of the names."""
    value = zlib.crc32(json.dumps(notes, sort_keys=True).encode())
    for name in sorted(state):
        value = zlib.crc32(state[name].reshape(-1).numpy().data, zlib.crc32(name.encode(), value))
    return value


def end_iteration(progress: Progress, checkpoint: Checkpoint | None, **metrics: float) -> None:
    """Count an iteration and save the fit if it is due; save it too before Cancelled is raised."""
    try:
        progress.step(1, **metrics)
    except Cancelled:
        if checkpoint is not None:
            checkpoint.save()
        raise
    if checkpoint is not None:
        checkpoint.save_if_due()
