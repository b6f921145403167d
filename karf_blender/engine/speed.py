"""The speed of the engine on this computer: measured once, corrected by finished jobs. No bpy.

It is kept in a file of the user's, for one Python with one number of threads.
"""

import contextlib
import json
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from ..engine_api import KarfError, read_json, write_json
from .processes import Inquiry

NEW = 0.5  # weight of the last job relative to all earlier ones
UNBELIEVABLE = 0.3  # share of its estimate below which a job had resumed another, or found its work done


@dataclass(frozen=True)
class Speed:
    """Knowledge about a computer."""

    python: str  # the engine's
    threads: int  # that it was given; 0: it chose
    samples_per_second: float = 0.0  # 0: not measured yet
    factors: dict[str, float] = field(default_factory=dict)  # by stage, seconds of jobs relative to the prediction

    def corrected(self, seconds: dict[str, float]) -> dict[str, float]:
        """Correct the seconds of stages that the speed alone predicts."""
        return {stage: promised * self.factors.get(stage, 1.0) for stage, promised in seconds.items()}

    def learned_from(self, stage: str, promised: float, taken: float) -> "Speed":
        """Return the same with the seconds that a job of a stage has taken."""
        factor = taken / promised
        if factor < UNBELIEVABLE * self.factors.get(stage, 1.0):
            return self
        known = self.factors.get(stage, factor)
        return replace(self, factors=self.factors | {stage: (1 - NEW) * known + NEW * factor})

    def write(self, file: Path) -> None:
        """Keep it; a disk that refuses does not matter."""
        with contextlib.suppress(OSError):
            write_json(file, asdict(self))


def read(file: Path, python: str, threads: int) -> Speed:
    """Read what is known of a Python with a number of threads; nothing where the file is of others or missing."""
    unknown = Speed(python, threads)
    try:
        known = Speed(**read_json(file, "speed"))
    except (OSError, KarfError, TypeError):
        return unknown
    return known if (known.python, known.threads) == (python, threads) else unknown


class Measurement(Inquiry):
    """The engine's `speed`; `poll` it until it gives an answer."""

    def __init__(self, python: Path, threads: int) -> None:
        super().__init__(python, "speed", threads=threads)

    def poll(self) -> float | None:
        """Return None while it runs; then the samples a second, 0 where it could not be measured."""
        if self.process.poll() is None:
            return None
        try:
            return float(json.loads(self.lines()[-1])["samples_per_second"])
        except (ValueError, IndexError, KeyError, TypeError):
            return 0.0
