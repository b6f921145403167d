"""How long a preset will take on this computer, before it is pressed; nothing where that is not known."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import bpy

from ... import __package__ as extension
from .. import engine_api, preferences, session
from ..engine import speed
from ..engine.speed import Speed
from ..engine_api import PRESETS, KarfError, MissingDependency, Request
from ..host import windows
from ..project import disk
from ..tasks import runner

POLL_SECONDS = 0.5
USUAL = 1e6  # samples a second of a computer that was not measured yet
SHORT = 1.0  # seconds of a job that trains nothing
STAGES = {"learn_scene": ("geometry",), "learn_all": ("geometry", "segmentation", "recoloring")}


@dataclass
class _State:
    """What is known of this computer, and the measurement that is at work."""

    known: Speed | None = None
    measurement: speed.Measurement | None = None

    def close(self) -> None:
        if self.measurement is not None:
            self.measurement.end()
            self.measurement = None


def seconds(preset: str, button: str, is_open: bool) -> float | None:
    """What pressing a button of step 2 will take with a preset; None where nothing is known."""
    if session.get(_State).known is None or not session.get(_State).known.samples_per_second:
        return None
    promised = _promised(preset, session.get(_State).known.samples_per_second, is_open)
    if promised is None:
        return None
    stages = session.get(_State).known.corrected(promised)
    return sum(stages[stage] for stage in STAGES[button])


def of_jobs(stages: Sequence[str], preset: str, is_open: bool) -> tuple[float, ...]:
    """What jobs of these stages will take, as well as it is known: each its share of a bar."""
    known = (
        session.get(_State).known
        if session.get(_State).known is not None and session.get(_State).known.samples_per_second
        else Speed("", 0, USUAL)
    )
    promised = known.corrected(_promised(preset, known.samples_per_second, is_open) or {})
    return tuple(promised.get(stage) or SHORT for stage in stages)


def measure_once() -> None:
    """Measure this computer alongside the interface, where that was not done yet with the engine as it is chosen."""
    if bpy.app.background or session.get(_State).measurement is not None or runner.is_running():
        return
    _read_once()
    if session.get(_State).known is None:
        return
    python, threads = Path(session.get(_State).known.python), session.get(_State).known.threads
    if session.get(_State).known.samples_per_second:
        return
    try:
        session.get(_State).measurement = speed.Measurement(python, engine_api.ENGINE_FOLDER, threads)
    except OSError:  # Test Engine says why
        return
    session.start_timer(_tick, POLL_SECONDS, persistent=True)


@session.listener(disk.READ)
def _read_once() -> None:
    """Take in what was kept of this computer, where there is an engine."""
    if session.get(_State).known is None:
        try:
            python, threads = preferences.engine_python(), preferences.current().threads
        except MissingDependency:
            return
        session.get(_State).known = speed.read(_file(), str(python), threads)


def _tick() -> float | None:
    """The timer: takes in what was measured. A job would be timed by what it leaves over, and is let go first."""
    if runner.is_running():
        session.get(_State).close()
        return None
    found = session.get(_State).measurement.poll()
    if found is None:
        return POLL_SECONDS
    session.get(_State).measurement = None
    session.get(_State).known = Speed(session.get(_State).known.python, session.get(_State).known.threads, found)
    if found:
        session.get(_State).known.write(_file())
    windows.redraw(*windows.PANEL_AREAS)
    return None


@session.listener(runner.JOB_DONE)
def _take_time(request: Request, taken: float) -> None:
    """Correct the estimates by a job that is done; its notes show whether its scene was open."""
    known, project = session.get(_State).known, engine_api.Project(request.project)
    if known is None or request.options.get("overrides"):
        return
    try:
        state = project.state()
    except KarfError:  # a job that finds camera poses begins a folder that is not yet a project
        return
    space = state["stages"].get("geometry", {}).get("space", "box")
    samples = _promised(state.get("settings", {}).get("preset", ""), 1.0, space != "box")
    if not samples or not samples.get(request.stage):
        return
    if not known.samples_per_second:  # the job came before the measurement, and is one
        known = replace(known, samples_per_second=samples[request.stage] / taken)
    session.get(_State).known = known.learned_from(
        request.stage, samples[request.stage] / known.samples_per_second, taken
    )
    session.get(_State).known.write(_file())


@lru_cache(maxsize=16)
def _promised(preset: str, samples_per_second: float, is_open: bool) -> dict[str, float] | None:
    settings = PRESETS.get(preset)
    return None if settings is None else engine_api.seconds_of_stages(settings, samples_per_second, is_open)


def _file() -> Path:
    return Path(bpy.utils.extension_path_user(extension, create=True)) / "speed.json"
