"""The project folder: every file's name, and which files belong together.

All that is learned lives here, next to the .blend. Files are data (json, npz, safetensors, png), never pickles.
A stage's outputs are gathered in a folder of their own until all are there, and take their places together (`commit`).

    project.json                 schema, capture, settings, each finished stage with checksums of its files
    capture.json                 the canonical capture (cameras, photo paths, split)
    masks/<object>/<view>.png    coarse masks, as given
    corrections/<object>/<view>.png  partial marks (see segmentation.corrections); no stage writes them
    volumes.json                 what objects must be inside or outside of (see project.volumes); no stage writes it
    earlier_masks/               those that a segmentation with other masks replaced
    geometry.safetensors         the radiance field
    unfinished_<stage>.safetensors   training that was interrupted, to resume from
    segmentation.safetensors     the segmentation field F_s        segmentation.json   its report
    surface.safetensors          surface samples of the objects' rays
    palette.json                 palettes as extracted, then as learned
    object_colors.npz            each object's color histogram with its palette weights (see edit.object_colors)
    recoloring.safetensors       the recoloring field F_w
    splats.safetensors           the scene as Gaussians (see splats/files.py)
    planes/<view>.npz            edit planes of a captured view (see palettes.compositing)
    looks/<scene>/<camera>.safetensors  cached renderings of captured views (see recolor/render_cache.py)
    photos/<view>-<digest>.png   photos without lens distortion, as Blender shows them behind its cameras
    jobs/<time>-<number>-<stage>/  request, events and log of each job (see project.jobs)
    .outputs/                    outputs of a stage at work
    lock, lock.json, commit.lock who may write now (see locking)
    .karf-*/                     a file that is being written (see io.files)
"""

from __future__ import annotations

import os
import shutil
import time
from pathlib import Path
from typing import Any

from ..errors import BadRequest, DataError
from ..io.containment import check_tree, inside, is_link
from ..io.files import checksum, remove_temporaries, replace
from ..io.names import check_name
from .state import STAGE_ORDER, new_state, read_state, without_stage, write_state

HOLDOUT_BEFORE = 8  # N of every Nth photo held out in projects that do not record it


class Project:
    """A project folder: the names of its files, and which of them are finished and belong together.

    Attributes:
        folder: Absolute path; it need not exist before `create`.
    """

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder).absolute()

    # --- names -----------------------------------------------------------------------------------------------------
    def path(self, *names: str) -> Path:
        """The path of these names in the project.

        Raises:
            DataError: A link on the way leads out of the project; see `io.containment`.
        """
        return inside(self.folder, *names)

    @property
    def state_file(self) -> Path:
        """Schema, capture, settings, and what each stage finished; see `project.state`."""
        return self.path("project.json")

    @property
    def capture_file(self) -> Path:
        """The canonical capture; see `capture.capture`."""
        return self.path("capture.json")

    @property
    def masks_folder(self) -> Path:
        """Coarse masks as given, `<object>/<view>.png`."""
        return self.path("masks")

    @property
    def corrections_folder(self) -> Path:
        """Partial marks as drawn, `<object>/<view>.png`; see `segmentation.corrections`."""
        return self.path("corrections")

    @property
    def volumes_file(self) -> Path:
        """Boxes and meshes that objects must be inside or outside of; see `project.volumes`."""
        return self.path("volumes.json")

    @property
    def geometry_file(self) -> Path:
        """The radiance field."""
        return self.path("geometry.safetensors")

    def checkpoint_file(self, stage: str) -> Path:
        """The training state of a stage that was interrupted."""
        return self.path(f"unfinished_{stage}.safetensors")

    @property
    def segmentation_file(self) -> Path:
        """The segmentation field F_s."""
        return self.path("segmentation.safetensors")

    @property
    def segmentation_report(self) -> Path:
        """What the segmentation measured."""
        return self.path("segmentation.json")

    @property
    def surface_file(self) -> Path:
        """Surface samples of the objects' rays."""
        return self.path("surface.safetensors")

    @property
    def doubts_file(self) -> Path:
        """How unsure the labels of surface points are."""
        return self.path("doubts.npz")

    @property
    def palette_file(self) -> Path:
        """Palettes as extracted, then as learned; see `palettes.palette`."""
        return self.path("palette.json")

    @property
    def object_colors_file(self) -> Path:
        """Each object's color histogram with its palette weights."""
        return self.path("object_colors.npz")

    @property
    def recoloring_file(self) -> Path:
        """The recoloring field F_w."""
        return self.path("recoloring.safetensors")

    @property
    def splats_file(self) -> Path:
        """The scene as Gaussians."""
        return self.path("splats.safetensors")

    @property
    def points_file(self) -> Path:
        """Points on the scene's surface, as the 3D View shows them."""
        return self.path("points.npz")

    @property
    def planes_folder(self) -> Path:
        """Edit planes of captured views; see `palettes.compositing`."""
        return self.path("planes")

    def planes_file(self, view: str) -> Path:
        """Edit planes of the captured view with this name."""
        return self.path("planes", f"{view}.npz")

    @property
    def looks_folder(self) -> Path:
        """The cached renderings of captured views; see `recolor.render_cache`."""
        return self.path("looks")

    @property
    def photos_folder(self) -> Path:
        """Photos without lens distortion, as Blender shows them behind its cameras."""
        return self.path("photos")

    @property
    def outputs_folder(self) -> Path:
        """Where the stage at work gathers its outputs, under the names that they will have in the project."""
        return self.path(".outputs")

    def new_job(self, stage: str) -> Path:
        """A fresh, empty job folder for a stage: `jobs/<time>-<number>-<stage>`."""
        stamp = time.strftime("%Y%m%d-%H%M%S")
        for attempt in range(1000):
            job = self.path("jobs", f"{stamp}-{attempt:03d}-{stage}")
            try:
                job.mkdir(parents=True)
                return job
            except FileExistsError:
                continue
        raise DataError(f"{self.folder / 'jobs'} is full of jobs of this second.", "Try again.")

    def contained(self, path: Path | str) -> Path:
        """Return a path, absolute; where it lies in the project, once no link on the way to it or in it leads out.

        Args:
            path: Of a file or folder, such as masks or an output, in the project or anywhere else.

        Raises:
            DataError: A link leads out; see `io.containment`.
        """
        path = Path(os.path.normpath(Path(path).absolute()))
        return check_tree(self.folder, path) if path.is_relative_to(self.folder) else path

    # --- state -----------------------------------------------------------------------------------------------------
    def create(self, capture: str) -> None:
        """Make the folder a project for the capture at this path; an existing project of the same capture is kept.

        Raises:
            BadRequest: The folder holds a project of another capture.
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
        """The content of project.json (see `project.state`).

        Raises:
            DataError: The folder is not a project, is of a newer version, or its project.json is damaged.
        """
        return read_state(self.state_file)

    def finished(self, stage: str) -> dict[str, Any] | None:
        """The summary that the stage noted when it finished (fingerprint, seconds, metrics); None where it has not."""
        return self.state()["stages"].get(stage)

    def require(self, stage: str) -> dict[str, Any]:
        """The summary of a finished stage.

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
        """N where the finished geometry was learned without every Nth photo and the capture declares none; 0: none.

        Those who learned before this was a choice had every 8th one held out.
        """
        geometry = self.finished("geometry") if self.state_file.exists() else None
        return geometry.get("holdout", HOLDOUT_BEFORE) if geometry else 0

    def finish(self, stage: str, fingerprint: str, **summary: Any) -> None:
        """Note that the stage is finished; later stages no longer are.

        Args:
            stage: One of `STAGE_ORDER`.
            fingerprint: Of the stage's inputs and settings.
            **summary: `files`, the checksums of its outputs; `settings`, its own ones; and what it measured.
        """
        state = without_stage(self.state(), stage)
        state["stages"][stage] = {"fingerprint": fingerprint, **summary}
        write_state(self.state_file, state)

    def set_settings(self, settings: dict[str, Any]) -> None:
        """Note the settings of stages that are still to run; finished ones keep those that they were run with."""
        state = self.state()
        if state.get("settings") != settings:
            write_state(self.state_file, state | {"settings": settings})

    # --- commits ---------------------------------------------------------------------------------------------------
    def commit(self, stage: str, fingerprint: str, settings: dict[str, Any], **summary: Any) -> None:
        """Put the gathered outputs in their places and note the stage as finished, with all settings.

        The new project.json is the last output. Once it is gathered the commit is decided: after a kill, `recover`
        completes it. Meanwhile neither this stage nor a later one counts as finished, so that old and new files never
        seem to be of one run.

        Args:
            stage: One of `STAGE_ORDER`.
            fingerprint: Of the stage's inputs and settings.
            settings: Of all stages, by stage.
            **summary: What the stage measured, for `finished`.

        Raises:
            OSError: The disk takes no more; the project is then as it was.
        """
        files = {path.name: checksum(path) for path in sorted(self.outputs_folder.iterdir()) if path.is_file()}
        state = without_stage(self.state(), stage)
        own = {"fingerprint": fingerprint, "files": files, "settings": settings[stage], **summary}
        stages = state["stages"] | {stage: own}
        write_state(self._decided_file, state | {"settings": settings, "stages": stages})
        try:
            write_state(self.state_file, state)
        except BaseException:
            self._decided_file.unlink()
            raise
        self.recover()

    @property
    def _decided_file(self) -> Path:
        return self.path(".outputs", "project.json")

    @property
    def is_interrupted(self) -> bool:
        """Whether a commit is under way, or was interrupted."""
        return self._decided_file.exists()

    def recover(self) -> None:
        """Complete a commit that was interrupted. Call it only while holding the lock for writing."""
        if not self.is_interrupted:
            return
        for path in sorted(check_tree(self.folder, self.outputs_folder).iterdir()):
            target = self.path(path.name)
            if path == self._decided_file or (
                path.is_dir() and target.exists() and _contents(path) == _contents(target)
            ):
                continue
            if path.is_dir() and target.exists():
                self._set_aside(target)
            replace(path, target)
        replace(self._decided_file, self.state_file)

    def _set_aside(self, folder: Path) -> None:
        """Make way for a new folder: what its files were stays, as the earlier ones."""
        earlier = self.path(f"earlier_{folder.name}")
        shutil.rmtree(earlier, ignore_errors=True)
        replace(folder, earlier)

    # --- checks ----------------------------------------------------------------------------------------------------
    def checked(self, path: Path) -> Path:
        """The path of a stage's output, once its checksum is that of what the stage wrote.

        A file of no finished stage, or of a project made before there were checksums, is left unchecked.

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
        """Whether all outputs of a finished stage are as they were written."""
        try:
            for name in self.require(stage).get("files", {}):
                self.checked(self.path(check_name(name, self.state_file, "a file")))
        except DataError:
            return False
        return True

    def _written_by(self, name: str) -> tuple[str | None, str]:
        """The last finished stage that wrote the file of this name, and the file's checksum."""
        stages = self.state()["stages"]
        for stage in reversed(STAGE_ORDER):
            found = stages.get(stage, {}).get("files", {})
            if name in found:
                return stage, found[name]
        return None, ""

    def remove_leftovers(self) -> None:
        """Delete what killed jobs left, except a commit to recover. Call it only while holding the lock for writing."""
        if not self.is_interrupted:
            shutil.rmtree(self.outputs_folder, ignore_errors=True)
        for folder in (self.folder, self.planes_folder, self.photos_folder):
            remove_temporaries(folder)
        for folder in (self.masks_folder, self.corrections_folder, self.looks_folder):
            for path in folder.glob("*/"):
                if not is_link(path):
                    remove_temporaries(path)


def _contents(folder: Path) -> dict[str, str]:
    """Checksums of all files in a folder."""
    return {str(path.relative_to(folder)): checksum(path) for path in folder.rglob("*") if path.is_file()}
