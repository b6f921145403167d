"""How fast the engine learns on this computer: measured once, corrected by the jobs that were done. No bpy.

It is kept in a file of the user's, for one Python with one number of threads.
"""

import contextlib
import json
import subprocess
import tempfile
from dataclasses import asdict, dataclass, field
from pathlib import Path

from ..engine_api import KarfError, read_json, write_json
from . import processes

NEW = 0.5  # weight of the last job relative to all earlier ones
UNBELIEVABLE = 0.3  # share of its estimate below which a job had resumed another, or found its work done


@dataclass(frozen=True)
class Speed:
    """What is known of a computer.

    Attributes:
        python: The engine's Python that was asked.
        threads: Those that it was given; 0: it chose.
        samples_per_second: As the engine has measured it; 0: not yet.
        factors: By stage, the seconds that jobs took relative to those that this speed predicts.
    """

    python: str
    threads: int
    samples_per_second: float = 0.0
    factors: dict[str, float] = field(default_factory=dict)

    def corrected(self, seconds: dict[str, float]) -> dict[str, float]:
        """What stages will take, from what the speed alone promises."""
        return {stage: promised * self.factors.get(stage, 1.0) for stage, promised in seconds.items()}

    def learned_from(self, stage: str, promised: float, taken: float) -> "Speed":
        """The same with what a job of a stage has taken."""
        factor = taken / promised
        if factor < UNBELIEVABLE * self.factors.get(stage, 1.0):
            return self
        known = self.factors.get(stage, factor)
        return Speed(
            self.python,
            self.threads,
            self.samples_per_second,
            self.factors | {stage: (1 - NEW) * known + NEW * factor},
        )

    def write(self, file: Path) -> None:
        """Keep it, where the disk lets us: it is not the user's work."""
        with contextlib.suppress(OSError):
            write_json(file, asdict(self))


def read(file: Path, python: str, threads: int) -> Speed:
    """What is known of this Python with this number of threads; nothing where the file is of others or missing."""
    unknown = Speed(python, threads)
    try:
        known = Speed(**read_json(file, "speed"))
    except (OSError, KarfError, TypeError):
        return unknown
    return known if (known.python, known.threads) == (python, threads) else unknown


class Measurement:
    """The engine's `speed` as a child process; `poll` it until it gives an answer."""

    def __init__(self, python: Path, engine: Path, threads: int) -> None:
        self._said = tempfile.TemporaryFile()
        command = processes.engine_command(python, engine, "speed")
        command += ["--threads", str(threads)] if threads else []
        self._process = processes.start(
            command, threads, stdin=subprocess.DEVNULL, stdout=self._said, stderr=subprocess.DEVNULL
        )

    def poll(self) -> float | None:
        """None while it runs; then the samples a second, 0 where it could not be measured."""
        if self._process.poll() is None:
            return None
        self._said.seek(0)
        try:
            return float(json.loads(self._said.read().splitlines()[-1])["samples_per_second"])
        except (ValueError, IndexError, KeyError, TypeError):
            return 0.0

    def end(self) -> None:
        """End it where it still runs."""
        if self._process.poll() is None:
            processes.end(self._process)
