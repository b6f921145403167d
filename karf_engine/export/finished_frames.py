"""Record of finished frames and their inputs, so that a stopped job can resume.

`finished.jsonl` in the output folder gets one line for each frame, after the frame's files are complete: a killed job
loses at most the current frame.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from ..capture.capture import Capture, View, capture_to_json, mask_files
from ..io.files import check_file, errors_naming_path, file_digest, fingerprint
from ..palettes.edge_shape import active_edges
from ..palettes.palette import Edit
from ..project import STAGE_ORDER, Project
from ..project.settings import Settings, to_dict
from .file_names import file_paths, named, tokens_of
from .frame_options import RECOLORED, FrameFileOptions, FrameOptions

VERSION = 4  # raise it when the same inputs give other pictures
RECORD_NAME = "finished.jsonl"


@dataclass(frozen=True)
class FinishedFrames:
    """The record of one output folder: the last entry of each frame by its name, at the time of reading."""

    folder: Path
    frames: dict[str, dict[str, Any]] = field(default_factory=dict)

    @classmethod
    def read(cls, folder: Path) -> FinishedFrames:
        """Read the record of a folder; incomplete lines of killed jobs are skipped."""
        path, frames = folder / RECORD_NAME, {}
        if not path.exists():
            return cls(folder)
        check_file(path)
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
            try:
                entry = json.loads(line)
                frames[str(entry["frame"])] = entry | {"made_from": entry["made_from"], "files": dict(entry["files"])}
            except (ValueError, KeyError, TypeError, RecursionError):
                continue
        return cls(folder, frames)

    def has(self, frame: str, made_from: str) -> bool:
        """Return whether a frame was made from the same inputs, and its files still have their sizes."""
        entry = self.frames.get(frame)
        if entry is None or entry["made_from"] != made_from:
            return False
        sizes = {name: _size(self.folder / name) for name in entry["files"]}
        return bool(sizes) and sizes == entry["files"]

    def record(
        self, frame: str, made_from: str, files: Iterable[Path], edit: Edit | None = None, **measured: Any
    ) -> None:
        """Append an entry for a written frame, with its edit and measurements; `frames` does not change."""
        if edit is not None:
            measured["edit"] = frame_fingerprint("", edit)
        sizes = {file.relative_to(self.folder).as_posix(): _size(file) for file in files}
        entry = {"frame": frame, "made_from": made_from, "files": sizes, **measured}
        path = self.folder / RECORD_NAME
        with errors_naming_path(path), path.open("a", encoding="utf-8") as stream:
            stream.write(f"\n{json.dumps(entry)}\n")  # after an incomplete line

    def edits(self) -> dict[str, str]:
        """Return which edit made each recolored picture, as `frame_fingerprint("", edit)`, by its path without suffix."""
        return {
            file.rpartition(".")[0]: entry["edit"]
            for entry in self.frames.values()
            for file in entry["files"]
            if "edit" in entry
        }


def _size(path: Path) -> int:
    """Return the bytes of a file, -1 if it is missing."""
    return path.stat().st_size if path.is_file() else -1


@dataclass(frozen=True)
class ModelFingerprint:
    """Fingerprints of what a project has learned with its settings of rendering, and of its masks."""

    learned: str
    masks: str


def model_fingerprint(project: Project, settings: Settings) -> ModelFingerprint:
    """Return the fingerprints of a project."""
    stages = {stage: project.finished(stage) or {} for stage in STAGE_ORDER}
    learned = {stage: [facts.get("fingerprint"), facts.get("files")] for stage, facts in stages.items()}
    folder = project.check_inside(project.masks_folder)
    masks = {path.relative_to(folder).as_posix(): file_digest(path) for path in mask_files(folder)}
    return ModelFingerprint(fingerprint(VERSION, learned, to_dict(settings.render)), fingerprint(masks))


def view_fingerprint(model: ModelFingerprint, view: View, *options: Any) -> str:
    """Return a fingerprint of a rendered view by `model_fingerprint`, camera, photo and options (JSON values)."""
    camera = capture_to_json(Capture(Path(), "", (replace(view, image=None),)))["views"]  # without the photo's path
    photo = [file_digest(view.image), model.masks] if view.image and view.image.is_file() else None
    return fingerprint(model.learned, camera, photo, *options)


def frame_fingerprint(view: str, edit: Edit | None) -> str:
    """Return a fingerprint of a frame by its `view_fingerprint` and its edit."""
    if edit is None:
        return view
    added = {  # without the default of `protect`, which older records lack
        name: [[each.picked.tolist(), each.reach, *([each.protect] if each.protect else [])] for each in own]
        for name, own in edit.added.items()
    }
    options = [{name: colors.tolist() for name, colors in edit.colors.items()}, edit.compositing]
    options += [added] if added else []
    edges = {name: asdict(shape) for name, shape in active_edges(edit.edges).items()}
    return fingerprint(view, *options, {"edges": edges}) if edges else fingerprint(view, *options)


def frame_key(options: FrameFileOptions, view: str) -> str:
    """Return the name of a view's frame in the record: of the usual pictures the view's, else the picture's path."""
    return view if options.names == RECOLORED else named(options.names, tokens_of(view))


def pending_frames(
    options: FrameFileOptions, learned: ModelFingerprint, views: Sequence[View], edits: Sequence[Edit | None]
) -> tuple[list[tuple[View, Edit | None, str]], FinishedFrames | None]:
    """Return the frames to write, with their edits and fingerprints, and the record of the output folder, if any.

    With `skip_existing` only missing frames and those made from other inputs. learned: of the loaded model. Raises
    BadRequest for impossible file names.
    """
    if options.out is None:
        return [(view, edit, "") for view, edit in zip(views, edits, strict=True)], None
    values = asdict(options.subset(FrameOptions)) | {"planes": options.planes, "threads": None, "device": None}
    own = {name: value for name, value in values.items() if value}
    file_paths(options.names, [tokens_of(view.name) for view in views])
    finished = FinishedFrames.read(options.out)
    frames = [
        (view, edit, frame_fingerprint(view_fingerprint(learned, view, own), edit))
        for view, edit in zip(views, edits, strict=True)
    ]
    if options.skip_existing:
        frames = [frame for frame in frames if not finished.has(frame_key(options, frame[0].name), frame[2])]
    return frames, finished
