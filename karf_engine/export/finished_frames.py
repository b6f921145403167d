"""Which frames of a long job are finished, and what each was made from: so that a job that was stopped can resume.

`finished.jsonl` in the output folder grows by one line a frame, after the frame's files are in their places: a killed
job loses at most the frame at work, and the note costs the same for the first frame as for the last.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from ..capture.capture import Capture, View, capture_to_json
from ..capture.mask_names import mask_files
from ..io.files import naming
from ..io.fingerprints import file_digest, fingerprint
from ..io.inputs import check_file
from ..palettes.edge_shape import shaped_edges
from ..palettes.palette import AddedColor, Edit
from ..project import STAGE_ORDER, Project
from ..project.settings import Settings, to_dict
from .frame_options import RenderOptions

VERSION = 4  # of the renderer: goes up when the same inputs would give other pictures
NOTE = "finished.jsonl"
# options that say which frames are made, where and how fast, not what is in them
NOT_OF_A_FRAME = {"project", "views", "first", "last", "count", "edit", "out", "threads", "device", "skip_existing"}


@dataclass(frozen=True)
class FinishedFrames:
    """The note of one output folder.

    Attributes:
        folder: Where the frames go.
        frames: What was noted of each when this was read, by its name; the last line counts.
    """

    folder: Path
    frames: dict[str, dict[str, Any]] = field(default_factory=dict)

    @classmethod
    def read(cls, folder: Path) -> FinishedFrames:
        """The note of a folder; lines that were cut off by a kill are passed over.

        Raises:
            DataError: A folder, a pipe or a device has its name.
        """
        path, frames = folder / NOTE, {}
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
        """Whether a frame was made from the same things, and its files are still there, as long as they were."""
        entry = self.frames.get(frame)
        if entry is None or entry["made_from"] != made_from:
            return False
        sizes = {name: _size(self.folder / name) for name in entry["files"]}
        return bool(sizes) and sizes == entry["files"]

    def note(self, frame: str, made_from: str, files: Iterable[Path], **measured: Any) -> None:
        """Add a line for a frame whose files are written, with what was measured of it; `frames` stay as read."""
        sizes = {path.relative_to(self.folder).as_posix(): _size(path) for path in files}
        entry = {"frame": frame, "made_from": made_from, "files": sizes, **measured}
        with naming(self.folder / NOTE), (self.folder / NOTE).open("a", encoding="utf-8") as stream:
            stream.write(f"\n{json.dumps(entry)}\n")  # a line that was cut off before must not swallow this one


def _size(path: Path) -> int:
    """Bytes of a file, -1 where it is missing."""
    return path.stat().st_size if path.is_file() else -1


@dataclass(frozen=True)
class ModelMark:
    """Texts that change when other frames would come of a project.

    Attributes:
        learned: By anything that is learned of it, and by how it renders.
        masks: By its rough masks, which say where thin parts of photos are.
    """

    learned: str
    masks: str


def model_mark(project: Project, settings: Settings) -> ModelMark:
    """What stands for a project as it is now."""
    stages = {stage: project.finished(stage) or {} for stage in STAGE_ORDER}
    learned = {stage: [facts.get("fingerprint"), facts.get("files")] for stage, facts in stages.items()}
    folder = project.contained(project.masks_folder)
    masks = {path.relative_to(folder).as_posix(): file_digest(path) for path in mask_files(folder)}
    return ModelMark(fingerprint(VERSION, learned, to_dict(settings.render)), fingerprint(masks))


def view_mark(model: ModelMark, view: View, *options: Any) -> str:
    """A text that changes when a view would be another: by the model, the camera, the photo or the options.

    Args:
        model: `model_mark`.
        view: With its photo, or a bare camera, to which masks say nothing.
        *options: JSON values.
    """
    camera = capture_to_json(Capture(Path(), "", (replace(view, image=None),)))["views"]  # wherever its photo lies
    photo = [file_digest(view.image), model.masks] if view.image and view.image.is_file() else None
    return fingerprint(model.learned, camera, photo, *options)


def frame_mark(view: str, edit: Edit | None) -> str:
    """A text that changes when a frame would be another: by its `view_mark`, or by its edit (None without one)."""
    if edit is None:
        return view
    added = {name: [_mark_of(each) for each in own] for name, own in edit.added.items()}
    options = [{name: colors.tolist() for name, colors in edit.colors.items()}, edit.compositing]
    options += [added] if added else []
    edges = {name: asdict(shape) for name, shape in shaped_edges(edit.edges).items()}
    return fingerprint(view, *options, {"edges": edges}) if edges else fingerprint(view, *options)


def _mark_of(color: AddedColor) -> list:
    # frames that were made before neutrals could be protected keep their marks
    return [color.picked.tolist(), color.reach, *([color.protect] if color.protect else [])]


@dataclass(frozen=True)
class PendingFrames:
    """The frames of a request that are still to make.

    Attributes:
        todo: Views with their edits and their marks, in order.
        finished: The note of the output folder; None where there is none.
    """

    todo: list[tuple[View, Edit | None, str]]
    finished: FinishedFrames | None

    def note(self, frame: str, made_from: str, files: Sequence[Path]) -> None:
        """Note a frame as finished, where it has files in an output folder."""
        if self.finished is not None:
            self.finished.note(frame, made_from, files)


def pending_frames(
    options: RenderOptions, learned: ModelMark, views: Sequence[View], edits: Sequence[Edit | None]
) -> PendingFrames:
    """All frames of a command; with its option `skip_existing` those that are not there, or made from other things.

    learned: `model_mark` as it was when the model was loaded.
    """
    if options.out is None:
        return PendingFrames([(view, edit, "") for view, edit in zip(views, edits, strict=True)], None)
    values = asdict(options)
    own = {name: value for name, value in values.items() if name not in NOT_OF_A_FRAME and value}
    finished = FinishedFrames.read(options.out)
    frames = [
        (view, edit, frame_mark(view_mark(learned, view, own), edit)) for view, edit in zip(views, edits, strict=True)
    ]
    if options.skip_existing:
        frames = [frame for frame in frames if not finished.has(frame[0].name, frame[2])]
    return PendingFrames(frames, finished)
