"""What every stage starts from: its project, settings, runtime, training images, and how it tells of its progress."""

from __future__ import annotations

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
from ..io.fingerprints import fingerprint
from ..io.options import Options
from ..project import BUILT_ON, STAGE_VERSIONS, Project
from ..project import settings as settings_module
from ..project.contents import capture_of, settings_for
from ..project.locking import consistent, opened, writing
from ..project.settings import Settings


@dataclass(frozen=True)
class Job:
    """One run of one stage. emit and should_stop are the caller's (see progress)."""

    project: Project
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
    """A stage at work.

    Attributes:
        checkpoint: What its fit has learned so far.
        summary: Its figures, noted when it is finished.
    """

    checkpoint: Checkpoint
    _outputs: Path
    summary: dict[str, Any] = field(default_factory=dict)

    def output(self, path: Path) -> Path:
        """Where to write what shall be this file or folder of the project, once all of the stage's outputs are there."""
        return self._outputs / path.name


def open_job(options: Options, emit: Emit, should_stop: Callable[[], bool]) -> Job:
    """Open the project of a command's options, whose geometry is learned, with the settings that it builds on."""
    project = opened(options.project)
    return make_job(project, options, settings_for(project, options.command), emit, should_stop)


def make_job(
    project: Project, options: Options, settings: Settings, emit: Emit, should_stop: Callable[[], bool]
) -> Job:
    """A job with a runtime of the options' threads and device."""
    runtime = start_runtime(settings.seed, options.threads, options.device)
    return Job(project, settings, runtime, emit, should_stop)


def stage_fingerprint(job: Job, stage: str, *inputs: Any) -> str:
    """Fingerprint of a stage: its version, its settings, its inputs and the stage it builds on."""
    before = job.project.require(BUILT_ON[stage])["fingerprint"] if stage in BUILT_ON else ""
    own = settings_module.to_dict(getattr(job.settings, stage))
    return fingerprint(stage, STAGE_VERSIONS[stage], before, job.settings.seed, own, *inputs)


@contextmanager
def run_stage(job: Job, stage: str, *inputs: Any) -> Iterator[StageRun | None]:
    """Run the body unless the stage is done with the same fingerprint, and put its outputs in their places afterwards.

    Yields None where there is nothing to do. inputs: JSON values, see `stage_fingerprint`. Raises BadRequest where
    another job holds the project.
    """
    project = job.project
    with writing(project):
        own = stage_fingerprint(job, stage, *inputs)
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
