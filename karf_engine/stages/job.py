"""What every stage starts from: its project, settings, runtime, plates, and how it tells of its progress."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import settings as settings_module
from ..capture.capture import Capture, View, capture_from_json
from ..errors import BadRequest, Diverged
from ..images import Plate, load_views
from ..progress import Emit, Progress, peak_memory_bytes
from ..project import STAGE_ORDER, Project, read_json
from ..runtime import Runtime, start_runtime
from ..settings import Settings
from ..unfinished import Unfinished
from ..wire import Request


@dataclass(frozen=True)
class Job:
    """One run of one stage. emit and should_stop are the caller's (see progress)."""

    project: Project
    options: dict[str, Any]
    settings: Settings
    runtime: Runtime
    emit: Emit
    should_stop: Callable[[], bool]

    def progress(self, stage: str, total: int) -> Progress:
        """Progress events of `total` steps under this name."""
        return Progress(self.emit, self.should_stop, stage, total)

    def unfinished(self, stage: str, mark: str) -> Unfinished:
        """Where this stage's learning is kept on the way. mark: the stage's fingerprint."""
        return Unfinished(self.project.unfinished_file(stage), mark, stage, self.emit)

    def capture(self) -> Capture:
        """The project's capture."""
        path = self.project.capture_file
        return capture_from_json(read_json(path, "capture"), path)

    def plates(self, views: Sequence[View], long_side: int | None = None) -> list[Plate]:
        """Photos of these views at the working size, or smaller."""
        working = self.settings.geometry.long_side
        return load_views(views, min(working, long_side or working))

    def artifact(self, kind: str, path: Path) -> None:
        """Tell the caller of a finished file."""
        self.emit("artifact", kind=kind, path=str(path))


def open_job(request: Request, emit: Emit, should_stop: Callable[[], bool]) -> Job:
    """Open the project of a request whose geometry stage has been started; settings are the project's own."""
    project = Project(request.project)
    stored = project.state().get("settings")
    if stored is None:
        raise BadRequest(f"{project.folder} has no settings yet.", "Run the geometry stage first.")
    settings = settings_module.from_dict(stored)
    return make_job(project, request.options, settings, emit, should_stop)


def make_job(
    project: Project, options: dict[str, Any], settings: Settings, emit: Emit, should_stop: Callable[[], bool]
) -> Job:
    """A job with a runtime as the options say (`threads`, `device`)."""
    runtime = start_runtime(settings.seed, options.get("threads"), options.get("device"))
    return Job(project, options, settings, runtime, emit, should_stop)


def fingerprint(*parts: Any) -> str:
    """A short text that changes when any JSON value in `parts` does."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]


def stage_fingerprint(job: Job, stage: str, *inputs: Any) -> str:
    """Fingerprint of a stage: its settings, its inputs and the stage before it."""
    number = STAGE_ORDER.index(stage)
    before = job.project.require(STAGE_ORDER[number - 1])["fingerprint"] if number else ""
    own = settings_module.to_dict(getattr(job.settings, stage))
    return fingerprint(stage, before, job.settings.seed, own, *inputs)


@contextmanager
def run_stage(job: Job, stage: str, mark: str) -> Iterator[dict[str, Any] | None]:
    """Run the body unless the stage is done with the same fingerprint, and note it as finished afterwards.

    Yields a dict for the stage's figures, or None where there is nothing to do.
    """
    done = job.project.finished(stage)
    if done is not None and done["fingerprint"] == mark:
        job.emit("stage", name=stage, text="already done")
        yield None
        return
    job.emit("stage", name=stage)
    facts: dict[str, Any] = {}
    start = time.perf_counter()
    unfinished = job.project.unfinished_file(stage)
    with job.project.lock():
        try:
            yield facts
        except Diverged:
            unfinished.unlink(missing_ok=True)  # what led there leads there again
            raise
        seconds = round(time.perf_counter() - start, 2)
        job.project.finish(stage, mark, seconds=seconds, peak_memory=peak_memory_bytes(), **facts)
        unfinished.unlink(missing_ok=True)
