"""What a stage has learned so far, on disk: a cancelled or killed fit resumes where it stood."""

from __future__ import annotations

import json
import time
import zlib
from pathlib import Path
from typing import Any, Protocol

from safetensors import SafetensorError
from torch import Tensor

from ..checkpoints import load_tensors, save_tensors
from ..errors import DataError, KarfError
from ..progress import Emit, Progress

SCHEMA = "karf-unfinished/1"
INTERVAL = 30.0  # seconds between two savings: what a killed job loses at most


class Resumable(Protocol):
    """What can be interrupted. iterations: of the whole; done: of those, so far.

    state: all that resuming takes, in tensors. resume(state): a fresh fit of the same inputs goes on from there and ends
    bit by bit where an uninterrupted one would on the same device; raises DataError, and changes nothing, where the
    state does not fit.
    """

    iterations: int
    done: int

    def state(self) -> dict[str, Tensor]: ...

    def resume(self, state: dict[str, Tensor]) -> None: ...


class Unfinished:
    """The file of one stage's fit. mark: fingerprint of the stage, by which a state of the same inputs is known.

    notes: JSON values to keep beside the fit; after `resume` those that were kept.
    """

    def __init__(self, path: Path, mark: str, stage: str, emit: Emit) -> None:
        self.notes: dict[str, Any] = {}
        self._path, self._mark, self._stage, self._emit = path, mark, stage, emit
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
        state, facts = load_tensors(self._path, SCHEMA)
        try:
            mark, notes, checksum = facts["fingerprint"], facts["notes"], facts["checksum"]
        except (KeyError, TypeError) as error:
            raise DataError(f"{self._path} does not say what it belongs to.") from error
        if mark != self._mark:
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
        facts = {"fingerprint": self._mark, "notes": self.notes, "checksum": _checksum(state, self.notes)}
        try:
            save_tensors(self._path, state, SCHEMA, facts)
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
