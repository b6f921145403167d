"""The context of every command on a project: settings, runtime, progress, and the commit of a stage's outputs."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ..capture.capture import Capture, View
from ..capture.training_images import TrainingImage, load_views
from ..compute.progress import Emit, Progress, peak_memory_bytes
from ..compute.runtime import Runtime, start_runtime
from ..errors import BadRequest, Diverged
from ..fields.fit import Checkpoint
from ..io.files import fingerprint
from ..io.options import Options
from ..project import BUILT_ON, STAGE_VERSIONS, Project
from ..project import settings as settings_module
from ..project.contents import read_capture, settings_for
from ..project.locking import write_lock
from ..project.settings import Settings
from .options import ProjectOptions

MAX_NAMED = 3  # views in one warning


@dataclass(frozen=True)
class Job:
    """One run of one command; `emit` and `should_stop` as in `compute.progress`."""

    project: Project
    settings: Settings
    runtime: Runtime
    emit: Emit
    should_stop: Callable[[], bool]

    def progress(self, stage: str, total: int) -> Progress:
        return Progress(self.emit, self.should_stop, stage, total)

    def capture(self) -> Capture:
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
        self.emit("artifact", kind=kind, path=str(path))


@dataclass(frozen=True)
class StageRun:
    """A running stage."""

    checkpoint: Checkpoint  # of its fit
    folder: Path  # of its outputs
    summary: dict[str, Any] = field(default_factory=dict)  # metrics, stored with the commit

    def output(self, path: Path) -> Path:
        """Return where to write the output that has this path in the project."""
        return self.folder / path.name


def open_job(
    options: ProjectOptions, emit: Emit, should_stop: Callable[[], bool], project: Project | None = None
) -> Job:
    """Open the project of a command's options, with learned geometry, and the settings for the command.

    project: a snapshot of the project, for commands that only read it.
    """
    project = project or Project(options.project)
    return make_job(project, options, settings_for(project, options.command), emit, should_stop)


def make_job(
    project: Project, options: Options, settings: Settings, emit: Emit, should_stop: Callable[[], bool]
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
    """Run the block, then commit the stage's outputs. Yields None if it is finished with the same fingerprint.

    Raises BadRequest if another job is writing to the project. inputs: JSON values, part of the fingerprint.
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
        checkpoint = Checkpoint(project.checkpoint_file(stage), own, stage, job.emit)
        run = StageRun(checkpoint, project.new_result(stage))
        try:
            yield run
            cost = {"seconds": round(time.perf_counter() - start, 2), "peak_memory": peak_memory_bytes()}
            project.commit(stage, run.folder, own, settings_module.to_dict(job.settings), **cost, **run.summary)
        except BaseException as error:
            project.discard(run.folder)
            if isinstance(error, Diverged):
                checkpoint.delete()  # resuming would diverge again
            raise
        project.place_masks()
        checkpoint.delete()


def warn_of_disputes(disputed: Mapping[str, Iterable[str]], emit: Emit) -> None:
    """Emit one warning per object whose photos contradict its learned edges. disputed: objects by the view's name."""
    views_of: dict[str, list[str]] = {}
    for view, objects in disputed.items():
        for name in objects:
            views_of.setdefault(name, []).append(view)
    for name, views in views_of.items():
        more = f" and {len(views) - MAX_NAMED} more" if len(views) > MAX_NAMED else ""
        where = ", ".join(views[:MAX_NAMED]) + more
        sentence = f"Photo and learned scene disagree about {name} in {where}: its edges there are the scene's."
        emit("warning", code="edges", sentence=sentence)
