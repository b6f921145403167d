"""What a stage has learned so far, on disk: a cancelled or killed fit resumes where it stood."""

from __future__ import annotations

import json
import time
import zlib
from pathlib import Path
from typing import Any, Protocol

from safetensors import SafetensorError
from torch import Tensor

from ...compute.progress import Emit, Progress
from ...errors import DataError, KarfError
from ...io.checkpoints import load_tensors, save_tensors

SCHEMA = "karf-unfinished/1"
INTERVAL = 30.0  # seconds between two savings: what a killed job loses at most


class Resumable(Protocol):
    """What can be interrupted.

    Attributes:
        iterations: Of the whole.
        done: Of those, so far.
    """

    iterations: int
    done: int

    def state(self) -> dict[str, Tensor]:
        """All that resuming takes."""

    def resume(self, state: dict[str, Tensor]) -> None:
        """Let this fresh fit resume a state, on the processor, of a fit of the same inputs.

        It ends bit by bit where an uninterrupted one would on the same device.

        Raises:
            DataError: The state is of another fit; nothing is changed then.
        """


class Checkpoint:
    """The file of one stage's fit.

    Attributes:
        notes: JSON values to keep beside the fit; after it has resumed, those that were kept.
    """

    def __init__(self, path: Path, fingerprint: str, stage: str, emit: Emit) -> None:
        """Nothing is read or written yet.

        Args:
            path: Of the file.
            fingerprint: Of the stage: only a state of the same one is resumed.
            stage: Its name, for events.
            emit: Receives events.
        """
        self.notes: dict[str, Any] = {}
        self._path, self._fingerprint, self._stage, self._emit = path, fingerprint, stage, emit
        self._fit: Resumable | None = None
        self._due = time.monotonic() + INTERVAL
        self._is_writable = True

    def follow(self, fit: Resumable, progress: Progress) -> None:
        """Save this fresh fit from now on; first let it resume what is left of one of the same inputs.

        What is damaged or of another version is removed with a warning.
        """
        self._fit = fit
        if not self._path.exists():
            return
        try:
            self._resume(fit)
        except DataError as error:
            self.remove()
            self._warn(f"Learning begins anew: {error.sentence}")
        if fit.done:
            progress.resume_at(fit.done)
            self._emit("stage", name=self._stage, text=f"resuming at iteration {fit.done} of {fit.iterations}")

    def _resume(self, fit: Resumable) -> None:
        state, metadata = load_tensors(self._path, SCHEMA)
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

    def offer(self) -> None:
        """Save if it is time to."""
        if time.monotonic() >= self._due:
            self.save()

    def save(self) -> None:
        """Write where the fit stands. A disk that takes nothing is a reason to warn, not to stop learning."""
        state = {name: tensor.detach().cpu().contiguous() for name, tensor in self._fit.state().items()}
        metadata = {
            "fingerprint": self._fingerprint,
            "notes": self.notes,
            "checksum": _checksum(state, self.notes),
        }
        try:
            save_tensors(self._path, state, SCHEMA, metadata)
        except (OSError, SafetensorError, KarfError) as error:
            if self._is_writable:
                self._warn(f"What is learned cannot be saved on the way, so that a killed job starts anew: {error}.")
            self._is_writable = False
        self._due = time.monotonic() + INTERVAL

    def remove(self) -> None:
        """Forget what was learned: the stage is finished, or must begin anew."""
        self._path.unlink(missing_ok=True)

    def _warn(self, sentence: str) -> None:
        self._emit("warning", code="unfinished", sentence=sentence)


def _checksum(state: dict[str, Tensor], notes: dict[str, Any]) -> int:
    """CRC-32 of everything, in the order of the names."""
    value = zlib.crc32(json.dumps(notes, sort_keys=True).encode())
    for name in sorted(state):
        value = zlib.crc32(state[name].reshape(-1).numpy(), zlib.crc32(name.encode(), value))
    return value
