"""The context of every command on a project: settings, runtime, progress, and the commit of a stage's outputs."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Protocol

from ..capture.capture import Capture, View
from ..capture.training_images import TrainingImage, load_views
from ..compute.progress import Emit, Progress, peak_memory_bytes
from ..compute.runtime import Runtime, start_runtime
from ..errors import BadRequest, Diverged
from ..fields.training.checkpoint import Checkpoint
from ..io.fingerprints import fingerprint
from ..project import BUILT_ON, STAGE_VERSIONS, Project
from ..project import settings as settings_module
from ..project.contents import read_capture, settings_for
from ..project.locking import open_project, read_lock, write_lock
from ..project.settings import Settings


class ProjectOptions(Protocol):
    """Options of a command on a project."""

    command: ClassVar[str]

    @property
    def project(self) -> Path: ...
    @property
    def threads(self) -> int | None: ...
    @property
    def device(self) -> str | None: ...


@dataclass(frozen=True)
class Job:
    """One run of one command; see `compute.progress` for `emit` and `should_stop`."""

    project: Project
    settings: Settings
    runtime: Runtime
    emit: Emit
    should_stop: Callable[[], bool]

    def progress(self, stage: str, total: int) -> Progress:
        """Return a counter of `total` steps under this name."""
        return Progress(self.emit, self.should_stop, stage, total)

    def capture(self) -> Capture:
        """Read the project's capture. Raises DataError where it is damaged."""
        return read_capture(self.project)

    def with_overrides(self, stage: str, overrides: Sequence[str]) -> Job:
        """Return the job with other settings of one stage. Raises BadRequest for settings of other stages."""
        settings = settings_module.with_overrides(self.settings, list(overrides))
        if replace(settings, **{stage: getattr(self.settings, stage)}) != self.settings:
            raise BadRequest(f"Only settings of {stage} can change now.", "Learn the scene again with the others.")
        return replace(self, settings=settings)

    def training_images(self, views: Sequence[View], long_side: int | None = None) -> list[TrainingImage]:
        """Load the photos of these views at the working size, or at a smaller `long_side`."""
        working = self.settings.geometry.long_side
        return load_views(views, min(working, long_side or working))

    def artifact(self, kind: str, path: Path) -> None:
        """Emit the path of a finished file."""
        self.emit("artifact", kind=kind, path=str(path))


@dataclass(frozen=True)
class StageRun:
    """A running stage.

    Attributes:
        checkpoint: The training state of its fit.
        summary: Its metrics, stored with the commit.
    """

    checkpoint: Checkpoint
    _outputs: Path
    summary: dict[str, Any] = field(default_factory=dict)

    def output(self, path: Path) -> Path:
        """Return the temporary path of an output that the commit moves to this path of the project."""
        return self._outputs / path.name


def open_job(options: ProjectOptions, emit: Emit, should_stop: Callable[[], bool]) -> Job:
    """Open the project of a command's options, with learned geometry, and the settings for the command."""
    project = open_project(options.project)
    return make_job(project, options, settings_for(project, options.command), emit, should_stop)


def make_job(
    project: Project, options: ProjectOptions, settings: Settings, emit: Emit, should_stop: Callable[[], bool]
) -> Job:
    """Make a job with a runtime of the options' threads and device."""
    runtime = start_runtime(settings.seed, options.threads, options.device)
    return Job(project, settings, runtime, emit, should_stop)


def stage_fingerprint(job: Job, stage: str, *inputs: Any) -> str:
    """Return the fingerprint of a stage's version, settings, inputs and the stage that it builds on."""
    before = job.project.require(BUILT_ON[stage])["fingerprint"] if stage in BUILT_ON else ""
    own = settings_module.to_dict(getattr(job.settings, stage))
    return fingerprint(stage, STAGE_VERSIONS[stage], before, job.settings.seed, own, *inputs)


@contextmanager
def run_stage(job: Job, stage: str, *inputs: Any) -> Iterator[StageRun | None]:
    """Run the block, then commit the stage's outputs.

    Args:
        job: The job.
        stage: One of `STAGE_ORDER`.
        *inputs: JSON values; part of the fingerprint, as are the stage's version, settings and the stage it builds on.

    Yields:
        The running stage; None where the stage is finished with the same fingerprint.

    Raises:
        BadRequest: Another job is writing to the project.
    """
    project = job.project
    with write_lock(project):
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
            with read_lock(project):
                project.commit(stage, own, settings_module.to_dict(job.settings), **cost, **run.summary)
            run.checkpoint.delete()
        except Diverged:
            run.checkpoint.delete()  # resuming would diverge again
            raise
        finally:
            project.remove_leftovers()
