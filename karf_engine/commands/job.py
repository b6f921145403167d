"""What every stage starts from: its project, settings, runtime, training images, and how it tells of its progress."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..capture.capture import Capture, View
from ..capture.training_images import TrainingImage, load_views
from ..compute.progress import Emit, Progress, peak_memory_bytes
from ..compute.runtime import Runtime, start_runtime
from ..errors import Diverged
from ..fields.training.checkpoint import Checkpoint
from ..project import STAGE_ORDER, Project
from ..project import settings as settings_module
from ..project.contents import capture_of, settings_for
from ..project.locking import consistent, opened, writing
from ..project.settings import Settings
from ..wire import Request

WHOLE_BYTES, END_BYTES = 2**20, 2**18  # files up to here count whole, larger ones by their ends


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

    def capture(self) -> Capture:
        """The project's capture. Raises DataError where it is damaged."""
        return capture_of(self.project)

    def training_images(self, views: Sequence[View], long_side: int | None = None) -> list[TrainingImage]:
        """Photos of these views at the working size, or smaller."""
        working = self.settings.geometry.long_side
        return load_views(views, min(working, long_side or working))

    def artifact(self, kind: str, path: Path) -> None:
        """Tell the caller of a finished file."""
        self.emit("artifact", kind=kind, path=str(path))


@dataclass(frozen=True)
class StageRun:
    """A stage at work. unfinished: what its fit has learned so far. summary: its figures, noted when it is finished."""

    checkpoint: Checkpoint
    _outputs: Path
    summary: dict[str, Any] = field(default_factory=dict)

    def output(self, path: Path) -> Path:
        """Where to write what shall be this file or folder of the project, once all of the stage's outputs are there."""
        return self._outputs / path.name


def open_job(request: Request, emit: Emit, should_stop: Callable[[], bool]) -> Job:
    """Open the project of a request whose geometry stage is finished, with the settings that its stage builds on."""
    project = opened(request.project)
    return make_job(project, request.options, settings_for(project, request.stage), emit, should_stop)


def make_job(
    project: Project, options: dict[str, Any], settings: Settings, emit: Emit, should_stop: Callable[[], bool]
) -> Job:
    """A job with a runtime as the options say (`threads`, `device`)."""
    runtime = start_runtime(settings.seed, options.get("threads"), options.get("device"))
    return Job(project, options, settings, runtime, emit, should_stop)


def fingerprint(*parts: Any) -> str:
    """A short text that changes when any JSON value in `parts` does."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]


def file_digest(path: Path) -> list:
    """What tells a file from another one in its place: its size, and a hash of its content.

    Of a file over 1 MiB, its first and last 256 KiB: whoever takes another picture changes these.
    """
    size = path.stat().st_size
    with path.open("rb") as stream:
        if size <= WHOLE_BYTES:
            content = stream.read()
        else:
            content = stream.read(END_BYTES)
            stream.seek(-END_BYTES, 2)
            content += stream.read()
    return [size, hashlib.sha256(content).hexdigest()]


def stage_fingerprint(job: Job, stage: str, version: int, *inputs: Any) -> str:
    """Fingerprint of a stage: its version, its settings, its inputs and the stage before it.

    version: of the stage's code, raised when the same inputs give another result.
    """
    number = STAGE_ORDER.index(stage)
    before = job.project.require(STAGE_ORDER[number - 1])["fingerprint"] if number else ""
    own = settings_module.to_dict(getattr(job.settings, stage))
    return fingerprint(stage, version, before, job.settings.seed, own, *inputs)


@contextmanager
def run_stage(job: Job, stage: str, version: int, *inputs: Any) -> Iterator[StageRun | None]:
    """Run the body unless the stage is done with the same fingerprint, and put its outputs in their places afterwards.

    Yields None where there is nothing to do. inputs: JSON values, see `stage_fingerprint`. Raises BadRequest where
    another job holds the project.
    """
    project = job.project
    with writing(project):
        own = stage_fingerprint(job, stage, version, *inputs)
        done = project.finished(stage)
        if done is not None and done["fingerprint"] == own and project.is_intact(stage):
            job.emit("stage", name=stage, text="already done")
            yield None
            return
        job.emit("stage", name=stage)
        start = time.perf_counter()
        run = StageRun(Checkpoint(project.checkpoint_file(stage), own, stage, job.emit), project.outputs_folder)
        try:
            yield run
            cost = {"seconds": round(time.perf_counter() - start, 2), "peak_memory": peak_memory_bytes()}
            with consistent(project):
                project.commit(stage, own, settings_module.to_dict(job.settings), **cost, **run.summary)
            run.checkpoint.remove()
        except Diverged:
            run.checkpoint.remove()  # what led there leads there again
            raise
        finally:
            project.remove_leftovers()
