"""Estimates of how long a preset will take on this computer; its speed is measured once and kept in a file."""

import contextlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from pathlib import Path

import bpy

from ... import __package__ as extension
from .. import engine_api, preferences, session
from ..engine.processes import Inquiry
from ..engine_api import PRESETS, KarfError, MissingDependency, Request, read_json, write_json
from ..host import windows
from ..project import disk
from ..tasks import runner

POLL_SECONDS = 0.5
USUAL = 1e6  # samples a second of a computer that was not measured yet
SHORT = 1.0  # seconds of a job that trains nothing
STAGES = {"learn_scene": ("geometry",), "learn_all": ("geometry", "segmentation", "recoloring")}
NEW = 0.5  # weight of the last job relative to all earlier ones
UNBELIEVABLE = 0.3  # share of its estimate below which a job had resumed another, or found its work done


@dataclass(frozen=True)
class Speed:
    python: str  # the engine's
    threads: int  # that it was given; 0: it chose
    samples_per_second: float = 0.0  # 0: not measured yet
    factors: dict[str, float] = field(default_factory=dict)  # by stage, seconds of jobs relative to the prediction

    def corrected(self, seconds: dict[str, float]) -> dict[str, float]:
        return {stage: promised * self.factors.get(stage, 1.0) for stage, promised in seconds.items()}

    def learned_from(self, stage: str, promised: float, taken: float) -> "Speed":
        """Return the same with the seconds that a job of a stage has taken."""
        factor = taken / promised
        if factor < UNBELIEVABLE * self.factors.get(stage, 1.0):
            return self
        known = self.factors.get(stage, factor)
        return replace(self, factors=self.factors | {stage: (1 - NEW) * known + NEW * factor})

    def write(self, file: Path) -> None:
        with contextlib.suppress(OSError):  # it would only be measured again
            write_json(file, asdict(self))


def read_speed(file: Path, python: str, threads: int) -> Speed:
    """Read what is known of a Python with a number of threads; nothing where the file is of another or missing."""
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


@dataclass
class ThisComputer:
    speed: Speed | None = None
    measurement: Measurement | None = None

    @property
    def samples_per_second(self) -> float:
        return self.speed.samples_per_second if self.speed is not None else 0

    def close(self) -> None:
        if self.measurement is not None:
            self.measurement.end()
            self.measurement = None


def seconds(preset: str, button: str, is_open: bool) -> float | None:
    """Estimate the duration of a button of step 3 with a preset; None if unknown."""
    computer = session.get(ThisComputer)
    if not computer.samples_per_second:
        return None
    promised = _promised(preset, computer.samples_per_second, is_open)
    if promised is None:
        return None
    stages = computer.speed.corrected(promised)
    return sum(stages[stage] for stage in STAGES[button])


def of_jobs(stages: Sequence[str], preset: str, is_open: bool) -> tuple[float, ...]:
    """Estimate the duration of jobs of these stages, for their shares of a progress bar."""
    computer = session.get(ThisComputer)
    known = computer.speed if computer.samples_per_second else Speed("", 0, USUAL)
    promised = known.corrected(_promised(preset, known.samples_per_second, is_open) or {})
    return tuple(promised.get(stage) or SHORT for stage in stages)


def measure_once() -> None:
    """Measure this computer alongside the interface, once for each engine."""
    computer = session.get(ThisComputer)
    if bpy.app.background or computer.measurement is not None or runner.is_running():
        return
    _read_once()
    if computer.speed is None or computer.samples_per_second:
        return
    python, threads = Path(computer.speed.python), computer.speed.threads
    try:
        computer.measurement = Measurement(python, threads)
    except OSError:  # Test Engine says why
        return
    session.start_timer(_tick, POLL_SECONDS, persistent=True)


@session.listener(disk.READ)
def _read_once() -> None:
    computer = session.get(ThisComputer)
    if computer.speed is None:
        try:
            python, threads = preferences.engine_python(), preferences.current().threads
        except MissingDependency:
            return
        computer.speed = read_speed(_file(), str(python), threads)


def _tick() -> float | None:
    computer = session.get(ThisComputer)
    if runner.is_running():  # both would be slower
        computer.close()
        return None
    found = computer.measurement.poll()
    if found is None:
        return POLL_SECONDS
    computer.measurement = None
    computer.speed = Speed(computer.speed.python, computer.speed.threads, found)
    if found:
        computer.speed.write(_file())
    windows.redraw()
    return None


@session.listener(runner.JOB_DONE)
def _take_time(request: Request, taken: float) -> None:
    """Correct the estimates by the duration of a job; its notes tell whether its scene was open."""
    computer, project = session.get(ThisComputer), engine_api.Project(request.project)
    if computer.speed is None or request.options.get("overrides"):
        return
    try:
        state = project.state()
    except KarfError:  # a job that finds camera poses begins a folder that is not yet a project
        return
    space = state["stages"].get("geometry", {}).get("space", "box")
    samples = (_promised(state.get("settings", {}).get("preset", ""), 1.0, space != "box") or {}).get(request.stage)
    if not samples:
        return
    known = computer.speed
    if not known.samples_per_second:  # the job came before the measurement, and is one
        known = replace(known, samples_per_second=samples / taken)
    computer.speed = known.learned_from(request.stage, samples / known.samples_per_second, taken)
    computer.speed.write(_file())


@lru_cache(maxsize=16)
def _promised(preset: str, samples_per_second: float, is_open: bool) -> dict[str, float] | None:
    settings = PRESETS.get(preset)
    return None if settings is None else engine_api.seconds_of_stages(settings, samples_per_second, is_open)


def _file() -> Path:
    return Path(bpy.utils.extension_path_user(extension, create=True)) / "speed.json"
