"""The project folder: file names, the state of stages, and atomic replacement of a stage's outputs.

Files are data (json, npz, safetensors, png), never pickles. A stage writes its outputs into `.outputs`; `commit` moves
them to their places together.

    project.json                 schema, capture, settings, each finished stage with checksums of its files
    capture.json                 the canonical capture (cameras, photo paths, split)
    masks/<object>/<view>.png    coarse masks, as given
    corrections/<object>/<view>.png  partial marks (see segmentation.corrections); no stage writes them
    volumes.json                 what objects must be inside or outside of (see project.volumes); no stage writes it
    earlier_masks/               the masks before the last segmentation with other masks
    geometry.safetensors         the radiance field
    unfinished_<stage>.safetensors   the state of interrupted training, to resume from
    segmentation.safetensors     the segmentation field F_s        segmentation.json   its report
    surface.safetensors          surface samples of the objects' rays
    doubts.npz                   the uncertainty of the surface points' labels
    palette.json                 palettes as extracted, then as learned
    object_colors.npz            each object's color histogram with its palette weights (see palettes.object_colors)
    recoloring.safetensors       the recoloring field F_w, where it is trained
    splats.safetensors           the scene as Gaussians (see splats/files.py)
    points.npz                   points on the scene's surface, for the 3D View
    planes/<view>.npz            edit planes of a captured view (see palettes.compositing)
    looks/<scene>/<camera>.safetensors  cached renderings of captured views (see recolor/render_cache.py)
    photos/<view>-<digest>.png   photos without lens distortion, as Blender shows them behind its cameras
    jobs/<time>-<number>-<stage>/  request, events and log of each job (see project.jobs)
    .outputs/                    outputs of a running stage
    lock, lock.json, commit.lock  locks for writing and for commits (see locking)
    .karf-*/                     temporary files (see io.files)
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
from .state import STAGE_ORDER, new_state, read_state, without_stage, write_state

LEGACY_HOLDOUT = 8  # every Nth photo was held out in projects that do not record N


class _Inside:
    """A file or folder of a project: reading the attribute gives its path, see `Project.path`."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, project: Project, owner: type[Project]) -> Path:
        return project.path(self._name)


class Project:
    """A project folder.

    Attributes:
        folder: Absolute path; it need not exist before `create`.
    """

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder).absolute()

    # --- names -----------------------------------------------------------------------------------------------------
    def path(self, *names: str) -> Path:
        """Return the path of these names in the project.

        Raises:
            DataError: A link in the path leads out of the project; see `io.containment`.
        """
        return checked_path(self.folder, *names)

    state_file = _Inside("project.json")
    capture_file = _Inside("capture.json")
    masks_folder = _Inside("masks")
    corrections_folder = _Inside("corrections")
    volumes_file = _Inside("volumes.json")
    geometry_file = _Inside("geometry.safetensors")
    segmentation_file = _Inside("segmentation.safetensors")
    segmentation_report = _Inside("segmentation.json")
    surface_file = _Inside("surface.safetensors")
    uncertainty_file = _Inside("doubts.npz")
    palette_file = _Inside("palette.json")
    object_colors_file = _Inside("object_colors.npz")
    recoloring_file = _Inside("recoloring.safetensors")
    splats_file = _Inside("splats.safetensors")
    points_file = _Inside("points.npz")
    planes_folder = _Inside("planes")
    render_cache_folder = _Inside("looks")
    photos_folder = _Inside("photos")
    outputs_folder = _Inside(".outputs")

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
        """Return a path as absolute; if it is in the project, refuse links in or below it that lead out.

        Args:
            path: A file or folder, such as masks or an output, in the project or anywhere else.

        Raises:
            DataError: A link leads out; see `io.containment`.
        """
        path = Path(os.path.normpath(Path(path).absolute()))
        return check_tree(self.folder, path) if path.is_relative_to(self.folder) else path

    # --- state -----------------------------------------------------------------------------------------------------
    def create(self, capture: str) -> None:
        """Make the folder a project for the capture at this path, unless it is one already.

        Raises:
            BadRequest: The folder is a project of another capture.
        """
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
        write_state(self.state_file, new_state(capture))

    def state(self) -> dict[str, Any]:
        """Read project.json (see `project.state`).

        Raises:
            DataError: The folder is not a project, is of a newer version, or its project.json is damaged.
        """
        return read_state(self.state_file)

    def finished(self, stage: str) -> dict[str, Any] | None:
        """Return the summary of a finished stage (fingerprint, seconds, metrics), or None."""
        return self.state()["stages"].get(stage)

    def has_output(self, stage: str, path: Path) -> bool:
        """Return whether a finished stage wrote this file; where it noted no files, whether the file exists."""
        files = self.require(stage).get("files")
        return path.exists() if files is None else path.name in files

    def require(self, stage: str) -> dict[str, Any]:
        """Return the summary of a finished stage.

        Raises:
            BadRequest: The stage is not finished.
        """
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

    def finish(self, stage: str, fingerprint: str, **summary: Any) -> None:
        """Mark the stage as finished, and the stages that build on it as not.

        Args:
            stage: One of `STAGE_ORDER`.
            fingerprint: Of the stage's inputs and settings.
            **summary: `files`, the checksums of its outputs; `settings`, the stage's; and its metrics.
        """
        state = without_stage(self.state(), stage)
        state["stages"][stage] = {"fingerprint": fingerprint, **summary}
        write_state(self.state_file, state)

    def set_settings(self, settings: dict[str, Any]) -> None:
        """Store the settings of stages that are yet to run; finished stages have their own copies."""
        state = self.state()
        if state.get("settings") != settings:
            write_state(self.state_file, state | {"settings": settings})

    # --- commits ---------------------------------------------------------------------------------------------------
    def commit(self, stage: str, fingerprint: str, settings: dict[str, Any], **summary: Any) -> None:
        """Move the stage's outputs to their places and mark the stage as finished.

        Writing the new project.json into `.outputs` decides the commit: after a kill, `recover` completes it. Until then
        neither this stage nor a later one counts as finished, so that old and new files are never mixed.

        Args:
            stage: One of `STAGE_ORDER`.
            fingerprint: Of the stage's inputs and settings.
            settings: The settings of all stages, by stage.
            **summary: The stage's metrics, for `finished`.

        Raises:
            OSError: The disk is full; the project is unchanged.
        """
        files = {path.name: checksum(path) for path in sorted(self.outputs_folder.iterdir()) if path.is_file()}
        state = without_stage(self.state(), stage)
        own = {"fingerprint": fingerprint, "files": files, "settings": settings[stage], **summary}
        stages = state["stages"] | {stage: own}
        write_state(self._commit_file, state | {"settings": settings, "stages": stages})
        try:
            write_state(self.state_file, state)
        except BaseException:
            self._commit_file.unlink()
            raise
        self.recover()

    @property
    def _commit_file(self) -> Path:
        return self.path(".outputs", "project.json")

    @property
    def is_interrupted(self) -> bool:
        """True while a commit is running, and after it was interrupted."""
        return self._commit_file.exists()

    def recover(self) -> None:
        """Complete an interrupted commit. Requires the lock for writing."""
        if not self.is_interrupted:
            return
        for path in sorted(check_tree(self.folder, self.outputs_folder).iterdir()):
            if path == self._commit_file:
                continue
            target = self.path(path.name)
            if path.is_dir() and target.exists():
                if _checksums(path) == _checksums(target):
                    continue
                earlier = self.path(f"earlier_{path.name}")
                shutil.rmtree(earlier, ignore_errors=True)
                replace(target, earlier)
            replace(path, target)
        replace(self._commit_file, self.state_file)

    # --- checks ----------------------------------------------------------------------------------------------------
    def verified(self, path: Path) -> Path:
        """Return the path of a stage's output after verifying its checksum; files without a checksum are not verified.

        Raises:
            DataError: The file is damaged or missing.
        """
        stage, expected = self._written_by(path.name)
        if stage is None or (path.exists() and checksum(path) == expected):
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
        try:
            for name in self.require(stage).get("files", {}):
                self.verified(self.path(check_name(name, self.state_file, "a file")))
        except DataError:
            return False
        return True

    def _written_by(self, name: str) -> tuple[str | None, str]:
        """Return the last finished stage that wrote the file of this name, and the file's checksum."""
        stages = self.state()["stages"]
        for stage in reversed(STAGE_ORDER):
            found = stages.get(stage, {}).get("files", {})
            if name in found:
                return stage, found[name]
        return None, ""

    def remove_leftovers(self) -> None:
        """Delete the leftovers of killed jobs, except a commit to recover. Requires the lock for writing."""
        if not self.is_interrupted:
            shutil.rmtree(self.outputs_folder, ignore_errors=True)
        for folder in (self.folder, self.planes_folder, self.photos_folder):
            remove_temporaries(folder)
        for folder in (self.masks_folder, self.corrections_folder, self.render_cache_folder):
            for path in folder.glob("*/"):
                if not is_link(path):
                    remove_temporaries(path)


def _checksums(folder: Path) -> dict[str, str]:
    return {str(path.relative_to(folder)): checksum(path) for path in folder.rglob("*") if path.is_file()}
