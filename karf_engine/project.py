"""The project folder: every file's name, how it is written, and who may write now.

All that is learned lives here, beside the .blend. Files are data (json, npz, safetensors, png), never pickles.
A file is written to a temporary name, flushed to disk and renamed, so that a killed job leaves the last good state.

    project.json                 schema, capture, settings, what each stage finished
    capture.json                 the canonical capture (cameras, photo paths, split)
    masks/<object>/<view>.png    coarse masks, as given
    geometry.safetensors         the radiance field
    unfinished_<stage>.safetensors   learning that was interrupted, to resume with
    segmentation.safetensors     the segmentation field F_s        segmentation.json   its report
    surface.safetensors          surface samples of the objects' rays
    palette.json                 palettes as extracted, then as learned
    object_colors.npz            each object's color histogram with its palette weights (see edit.match)
    recoloring.safetensors       the recoloring field F_w
    planes/<view>.npz            edit planes of a captured view (see edit.compositing)
    photos/<view>-<mark>.png     photos without lens distortion, as Blender shows them behind its cameras
    jobs/<time>-<stage>/         request, events and log of each job
"""

from __future__ import annotations

import json
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from .errors import BadRequest, DataError

SCHEMA = "karf-project/1"
STAGE_ORDER = ("geometry", "segmentation", "palette", "recoloring")


def atomic_write(path: Path, write: Callable[[Path], None]) -> None:
    """Call `write(temporary_path)`, flush it to disk and rename it to `path`; on any failure `path` stays as it was."""
    path.parent.mkdir(parents=True, exist_ok=True)
    # keep the suffix: image and npz writers choose the format by it
    handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        write(temporary)
        with temporary.open("rb+") as stream:
            os.fsync(stream.fileno())
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def write_json(path: Path, content: Any) -> None:
    """Write JSON atomically, indented so that a person can read it."""
    text = json.dumps(content, indent=1, allow_nan=False)
    atomic_write(path, lambda temporary: temporary.write_text(text + "\n", encoding="utf-8"))


def read_json(path: Path, what: str) -> Any:
    """Read a JSON file that is called `what` in messages. Raises DataError naming file, line and reason."""
    try:
        return json.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError as error:
        raise DataError(f"{path} ({what}) does not exist.", "Check the path.") from error
    except json.JSONDecodeError as error:
        raise DataError(
            f"{path} ({what}) is broken JSON at line {error.lineno}: {error.msg}.", "Export or write the file again."
        ) from error
    except (OSError, ValueError, RecursionError) as error:  # no text, numbers without end, brackets without end
        raise DataError(f"{path} ({what}) cannot be read: {error}.", "Check the file.") from error


class Project:
    """A project folder and the names of the files in it."""

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder).absolute()

    # --- names -----------------------------------------------------------------------------------------------------
    @property
    def state_file(self) -> Path:
        return self.folder / "project.json"

    @property
    def capture_file(self) -> Path:
        return self.folder / "capture.json"

    @property
    def masks_folder(self) -> Path:
        return self.folder / "masks"

    @property
    def geometry_file(self) -> Path:
        return self.folder / "geometry.safetensors"

    def unfinished_file(self, stage: str) -> Path:
        """Where the stage's learning stood when it was last saved."""
        return self.folder / f"unfinished_{stage}.safetensors"

    @property
    def segmentation_file(self) -> Path:
        return self.folder / "segmentation.safetensors"

    @property
    def segmentation_report(self) -> Path:
        return self.folder / "segmentation.json"

    @property
    def surface_file(self) -> Path:
        return self.folder / "surface.safetensors"

    @property
    def palette_file(self) -> Path:
        return self.folder / "palette.json"

    @property
    def object_colors_file(self) -> Path:
        return self.folder / "object_colors.npz"

    @property
    def recoloring_file(self) -> Path:
        return self.folder / "recoloring.safetensors"

    @property
    def planes_folder(self) -> Path:
        return self.folder / "planes"

    def planes_file(self, view: str) -> Path:
        """Edit planes of the captured view with this name."""
        return self.planes_folder / f"{view}.npz"

    @property
    def photos_folder(self) -> Path:
        return self.folder / "photos"

    def new_job(self, stage: str) -> Path:
        """A fresh, empty job folder for a stage."""
        stamp = time.strftime("%Y%m%d-%H%M%S")
        for attempt in range(1000):
            job = self.folder / "jobs" / f"{stamp}-{attempt:03d}-{stage}"
            try:
                job.mkdir(parents=True)
                return job
            except FileExistsError:
                continue
        raise DataError(f"{self.folder / 'jobs'} is full of jobs of this second.", "Try again.")

    # --- state -----------------------------------------------------------------------------------------------------
    def create(self, capture: str) -> None:
        """Make the folder a project for the capture at this path; an existing project of the same capture is kept."""
        if self.state_file.exists():
            known = self.state()["capture"]
            if known != capture:
                raise BadRequest(
                    f"{self.folder} already holds a project of {known}.", f"Choose another folder for {capture}."
                )
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        write_json(self.state_file, {"schema": SCHEMA, "capture": capture, "stages": {}})

    def state(self) -> dict[str, Any]:
        """The content of project.json. Raises DataError where the folder is no project or a newer one."""
        if not self.state_file.exists():
            raise DataError(
                f"{self.folder} is no KaRF project (project.json is missing).",
                "Give the folder that the geometry stage wrote.",
            )
        state = read_json(self.state_file, "project state")
        schema = state.get("schema") if isinstance(state, dict) else None
        if schema != SCHEMA:
            raise DataError(f"{self.state_file} has schema {schema!r}, not {SCHEMA}.", "Update KaRF, or start anew.")
        if not isinstance(state.get("capture"), str) or not isinstance(state.get("stages"), dict):
            raise DataError(f"{self.state_file} lacks its capture or its stages.", "Start anew in an empty folder.")
        return state

    def finished(self, stage: str) -> dict[str, Any] | None:
        """What the stage noted when it finished (fingerprint, seconds, figures), or None."""
        return self.state()["stages"].get(stage)

    def finish(self, stage: str, fingerprint: str, **facts: Any) -> None:
        """Note that the stage is done with inputs of this fingerprint; later stages of other inputs are forgotten."""
        state = self.state()
        state["stages"][stage] = {"fingerprint": fingerprint, **facts}
        if stage in STAGE_ORDER:
            for later in STAGE_ORDER[STAGE_ORDER.index(stage) + 1 :]:
                state["stages"].pop(later, None)
        write_json(self.state_file, state)

    def require(self, stage: str) -> dict[str, Any]:
        """What the stage noted; raises BadRequest naming the stage to run first where it is not done."""
        done = self.finished(stage)
        if done is None:
            raise BadRequest(f"{self.folder} has no finished {stage} stage.", f"Run the {stage} stage first.")
        return done

    # --- one writer ------------------------------------------------------------------------------------------------
    @contextmanager
    def lock(self) -> Iterator[None]:
        """Hold the project for writing. Raises BadRequest where a living process holds it."""
        path = self.folder / "lock"
        self.folder.mkdir(parents=True, exist_ok=True)
        while True:
            try:
                handle = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY)
                break
            except FileExistsError:
                holder = _lock_holder(path)
                if holder is not None:
                    raise BadRequest(
                        f"{self.folder} is in use by process {holder}.", "Wait for that job or cancel it."
                    ) from None
                path.unlink(missing_ok=True)
        with os.fdopen(handle, "w") as stream:
            json.dump({"pid": os.getpid(), "start": _process_start(os.getpid())}, stream)
        try:
            yield
        finally:
            path.unlink(missing_ok=True)


def _lock_holder(path: Path) -> int | None:
    """The process that holds the lock, or None where it has ended or the lock is unreadable."""
    try:
        content = json.loads(path.read_text())
        pid, start = int(content["pid"]), content["start"]
    except (OSError, ValueError, KeyError, TypeError):
        # a lock in the very act of being written is empty: treat it as held while it is young
        young = path.exists() and time.time() - path.stat().st_mtime < 2.0
        return 0 if young else None
    if not _is_alive(pid):
        return None
    # a recycled process number belongs to somebody else: its start time differs
    return pid if _process_start(pid) == start else None


def _is_alive(pid: int) -> bool:
    if os.name == "nt":  # os.kill would end the process there
        return True
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def _process_start(pid: int) -> str:
    """The kernel's start time of a process where it tells (Linux), else an empty word."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[19]
    except (OSError, IndexError):
        return ""
