"""The project folder: file names, the state of stages, and the results of stages.

Files are data (json, npz, safetensors, png), never pickles. Each run of a stage writes its outputs into a new folder in
`results`, which does not change once project.json names it. Replacing project.json finishes the stage::

    project.json                 schema, capture, settings; of each finished stage its folder and its files' checksums
    results/<stage>-<number>/    outputs of a stage:
        capture.json                 the canonical capture (cameras, photo paths, split)
        geometry.safetensors         the radiance field
        segmentation.safetensors     the segmentation field F_s        segmentation.json   its report
        surface.safetensors          surface samples of the objects' rays
        doubts.npz                   the uncertainty of the surface points' labels
        palette.json                 palettes as extracted, then as learned
        object_colors.npz            each object's color histogram with its palette weights (see palettes.object_colors)
        recoloring.safetensors       the recoloring field F_w, where it is trained
        splats.safetensors           the scene as Gaussians (see splats/files.py)
        draft.safetensors            what they were before objects were learned in detail
    masks/<object>/<view>.png    coarse masks, as given
    earlier_masks/               the masks before the last segmentation with other masks
    corrections/<object>/<view>.png  partial marks (see segmentation.corrections)
    volumes.json                 what objects must be inside or outside of (see project.volumes)
    unfinished_<stage>.safetensors   the state of interrupted training, to resume from
    points.npz                   points on the scene's surface, for the 3D View
    planes/<view>.npz            edit planes of a captured view (see palettes.compositing)
    looks/<scene>/<camera>.safetensors  cached renderings of captured views (see recolor/render_cache.py)
    photos/<view>-<digest>.png   photos without lens distortion, as Blender shows them behind its cameras
    jobs/<time>-<number>-<stage>/  request, events and log of each job (see project.jobs)
    lock, lock.json              the lock for writing (see locking)
    .karf-*/                     temporary files (see io.files)

Earlier versions wrote the outputs of stages beside project.json; they are read from there.
"""

from __future__ import annotations

import os
import shutil
import time
from pathlib import Path
from typing import Any

from ..errors import BadRequest, DataError
from ..io.containment import check_tree, checked_path, is_link
from ..io.files import checksum, remove_temporaries, replace
from ..io.names import check_name
from .state import SCHEMA, STAGE_ORDER, read_state, without_stage, write_state

RESULTS = "results"
READING_SECONDS = 60.0  # for which results that were replaced stay: jobs may be reading them
LEGACY_HOLDOUT = 8  # every Nth photo was held out in projects that do not record N


class _Inside:
    """A file or folder of a project: reading the attribute gives its path, see `Project.path`."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, project: Project, owner: type[Project]) -> Path:
        return project.path(self._name)


class _Output(_Inside):
    """An output of a stage: reading the attribute gives its path, see `Project.output`."""

    def __get__(self, project: Project, owner: type[Project]) -> Path:
        return project.output(self._name)


class Project:
    """A project folder; it need not exist before `create`.

    With a `state` (see `snapshot`), project.json is not read again.
    """

    def __init__(self, folder: Path | str, state: dict[str, Any] | None = None) -> None:
        self.folder = Path(folder).absolute()
        self._state = state

    def snapshot(self) -> Project:
        """Return this project as it is now, with the same results when jobs finish stages. Raises DataError as `state`."""
        return Project(self.folder, self.state())

    def path(self, *names: str) -> Path:
        """Return the path of these names in the project. Raises DataError if a link in it leads out of the project."""
        return checked_path(self.folder, *names)

    state_file = _Inside("project.json")
    capture_file = _Output("capture.json")
    corrections_folder = _Inside("corrections")
    volumes_file = _Inside("volumes.json")
    geometry_file = _Output("geometry.safetensors")
    segmentation_file = _Output("segmentation.safetensors")
    segmentation_report = _Output("segmentation.json")
    surface_file = _Output("surface.safetensors")
    uncertainty_file = _Output("doubts.npz")
    palette_file = _Output("palette.json")
    object_colors_file = _Output("object_colors.npz")
    recoloring_file = _Output("recoloring.safetensors")
    splats_file = _Output("splats.safetensors")
    draft_file = _Output("draft.safetensors")
    points_file = _Inside("points.npz")
    planes_folder = _Inside("planes")
    render_cache_folder = _Inside("looks")
    photos_folder = _Inside("photos")

    def output(self, name: str, stage: str | None = None) -> Path:
        """Return the path of an output of a finished stage, by default of the last one that wrote a file of this name.

        Raises DataError if project.json names no valid path, or a link in it leads out of the project.
        """
        stage = stage or self._stage_of(name)
        folder = self.state()["stages"][stage].get("folder") if stage else None
        check_name(name, self.state_file, "a file")
        if folder is None:
            return self.path(name)
        return self.path(RESULTS, check_name(folder, self.state_file, "a result"), name)

    @property
    def masks_folder(self) -> Path:
        """Path of the masks: `masks`, or for a moment the masks in the result of a segmentation with other masks."""
        result = self.segmentation_report.parent.relative_to(self.folder)
        new = self.path(*result.parts, "masks")
        return new if new.is_dir() else self.path("masks")

    def new_result(self, stage: str) -> Path:
        """Make an empty folder for the outputs of a stage, numbered after its earlier ones."""
        names = [path.name.removeprefix(f"{stage}-") for path in self.path(RESULTS).glob(f"{stage}-*")]
        numbers = [int(name) for name in names if name.isascii() and name.isdecimal()]
        folder = self.path(RESULTS, f"{stage}-{max(numbers, default=0) + 1}")
        folder.mkdir(parents=True)
        return folder

    def discard(self, result: Path) -> None:
        """Delete a folder of outputs, unless a finished stage has it."""
        if result.name not in {summary.get("folder") for summary in self.state()["stages"].values()}:
            shutil.rmtree(result, ignore_errors=True)

    def checkpoint_file(self, stage: str) -> Path:
        """Return the path of an interrupted stage's training state."""
        return self.path(f"unfinished_{stage}.safetensors")

    def planes_file(self, view: str) -> Path:
        """Return the path of a captured view's edit planes."""
        return self.path("planes", f"{view}.npz")

    def new_job(self, stage: str) -> Path:
        """Make an empty job folder for a stage: `jobs/<time>-<number>-<stage>`."""
        stamp = time.strftime("%Y%m%d-%H%M%S")
        for attempt in range(1000):
            job = self.path("jobs", f"{stamp}-{attempt:03d}-{stage}")
            try:
                job.mkdir(parents=True)
                return job
            except FileExistsError:
                continue
        raise DataError(f"{self.folder / 'jobs'} is full of jobs of this second.", "Try again.")

    def check_inside(self, path: Path | str) -> Path:
        """Return a path as absolute. Raises DataError if it is in the project, and a link in or below it leads out."""
        path = Path(os.path.normpath(Path(path).absolute()))
        return check_tree(self.folder, path) if path.is_relative_to(self.folder) else path

    def create(self, capture: str) -> None:
        """Make the folder a project for the capture at this path. Raises BadRequest if it has one of another capture."""
        if self.state_file.exists():
            known = self.state()["capture"]
            if known != capture:
                raise BadRequest(
                    "{folder} already holds a project of {known}.",
                    "Choose another folder for {capture}.",
                    folder=self.folder,
                    known=known,
                    capture=capture,
                )
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        write_state(self.state_file, {"schema": SCHEMA, "capture": capture, "stages": {}})

    def state(self) -> dict[str, Any]:
        """Return the content of project.json, see `project.state`. Raises DataError as `read_state`."""
        return read_state(self.state_file) if self._state is None else self._state

    def finished(self, stage: str) -> dict[str, Any] | None:
        """Return the summary of a finished stage (fingerprint, seconds, metrics), or None."""
        return self.state()["stages"].get(stage)

    def has_output(self, stage: str, path: Path) -> bool:
        """Return whether a finished stage wrote this file; where it noted no files, whether the file exists."""
        files = self.require(stage).get("files")
        return path.exists() if files is None else path.name in files

    def require(self, stage: str) -> dict[str, Any]:
        """Return the summary of a finished stage. Raises BadRequest if it is not finished."""
        summary = self.finished(stage)
        if summary is None:
            raise BadRequest(
                "{folder} has no finished {stage} stage.",
                "Run the {stage} stage first.",
                folder=self.folder,
                stage=stage,
            )
        return summary

    def holdout(self) -> int:
        """Return N if the finished geometry was learned without every Nth photo, else 0."""
        geometry = self.finished("geometry") if self.state_file.exists() else None
        return geometry.get("holdout", LEGACY_HOLDOUT) if geometry else 0

    def left_out(self) -> tuple[str, ...]:
        """Return the names of the photos that the finished geometry was learned without."""
        geometry = self.finished("geometry") if self.state_file.exists() else None
        return tuple(geometry.get("without", ())) if geometry else ()

    def finish(self, stage: str, fingerprint: str, **summary: Any) -> None:
        """Mark the stage as finished, and the stages that build on it as not.

        `fingerprint` is that of its inputs and settings; `summary` has its `settings`, its metrics, and `folder` and
        `files` of its outputs (see `commit`).
        """
        self._finish(stage, {"fingerprint": fingerprint, **summary})

    def _finish(self, stage: str, summary: dict[str, Any], **entries: Any) -> None:
        state = without_stage(self.state(), stage)
        state["stages"][stage] = summary
        write_state(self.state_file, state | entries)

    def commit(self, stage: str, result: Path, fingerprint: str, settings: dict[str, Any], **summary: Any) -> None:
        """Finish a stage, as `finish`, with the outputs in `result`, a folder of `new_result` that must not change later.

        Replacing project.json is the only change: after a kill at any moment, the stage is finished or as before.
        """
        own = {"fingerprint": fingerprint, **_outputs(result), "settings": settings[stage], **summary}
        self._finish(stage, own, settings=settings)

    def amend(self, stage: str, result: Path, **summary: Any) -> None:
        """Replace the outputs of a finished stage, as `commit`, and these entries of its summary.

        It keeps its fingerprint, and later stages stay finished.
        """
        state = self.state()
        own = state["stages"][stage] | _outputs(result) | summary
        write_state(self.state_file, state | {"stages": state["stages"] | {stage: own}})

    def set_settings(self, settings: dict[str, Any]) -> None:
        """Store the settings of stages that are yet to run; finished stages have their own copies."""
        state = self.state()
        if state.get("settings") != settings:
            write_state(self.state_file, state | {"settings": settings})

    def place_masks(self) -> None:
        """Move new masks of the segmentation to `masks`; other masks before become earlier_masks. Requires the lock.

        A job that was killed between its commit and this leaves it to the next job; see `masks_folder`.
        """
        new, masks, earlier = self.masks_folder, self.path("masks"), self.path("earlier_masks")
        if new == masks:
            return
        check_tree(self.folder, masks)
        if masks.exists() and _checksums(new) == _checksums(masks):
            shutil.rmtree(new)
            return
        if masks.exists():
            shutil.rmtree(earlier, ignore_errors=True)
            replace(masks, earlier)
        replace(new, masks)

    def verified(self, path: Path) -> Path:
        """Return the path of a stage's output. Raises DataError if it is missing, or has another checksum than noted."""
        stages = self.state()["stages"]
        owners = [name for name in stages if stages[name].get("folder") == path.parent.name]
        stage = next((name for name in owners if path.name in stages[name].get("files", {})), self._stage_of(path.name))
        if stage is None or (path.exists() and checksum(path) == stages[stage]["files"][path.name]):
            return path
        raise DataError(
            "{path} is {state}: it is not what the {stage} stage wrote.",
            "Run the {stage} stage again; what is intact is kept.",
            path=path,
            state="damaged" if path.exists() else "missing",
            stage=stage,
        )

    def is_intact(self, stage: str) -> bool:
        """Return whether the checksums of all outputs of a finished stage match."""
        summary = self.require(stage)
        for name, expected in summary.get("files", {}).items():
            if "folder" not in summary:  # of an earlier version: a later stage may have replaced the file
                stage = self._stage_of(name) or stage
                expected = self.state()["stages"][stage]["files"][name]
            path = self.output(name, stage)
            if not path.exists() or checksum(path) != expected:
                return False
        return True

    def _stage_of(self, name: str) -> str | None:
        """Return the last finished stage that wrote a file of this name."""
        stages = self.state()["stages"] if self._state or self.state_file.exists() else {}
        return next((stage for stage in reversed(STAGE_ORDER) if name in stages.get(stage, {}).get("files", {})), None)

    def remove_leftovers(self) -> None:
        """Delete temporary files and results that no finished stage has. Requires the lock for writing."""
        self.place_masks()
        if self.state_file.exists() and time.time() - self.state_file.stat().st_mtime > READING_SECONDS:
            for folder in self.path(RESULTS).glob("*/"):
                if not is_link(folder):
                    self.discard(folder)
        for folder in (self.folder, self.planes_folder, self.photos_folder):
            remove_temporaries(folder)
        for folder in (self.masks_folder, self.corrections_folder, self.render_cache_folder):
            for path in folder.glob("*/"):
                if not is_link(path):
                    remove_temporaries(path)


def _outputs(result: Path) -> dict[str, Any]:
    """Return the entries of a stage's summary that name its outputs."""
    files = {path.name: checksum(path) for path in sorted(result.iterdir()) if path.is_file()}
    return {"folder": result.name, "files": files}


def _checksums(folder: Path) -> dict[str, str]:
    return {str(path.relative_to(folder)): checksum(path) for path in folder.rglob("*") if path.is_file()}
