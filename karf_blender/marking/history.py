"""Files of marks that follow Blender's undo: the scene stores its step's number, the session the files after it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy

from .. import session
from ..engine_api import atomic_write, checked_path

Files = Mapping[Path, bytes | None]  # contents; None: no such file


@dataclass(frozen=True)
class Step:
    files: Files = field(default_factory=dict)  # after a stroke, all that were ever changed
    note: Any = None  # what else must come back with it


@dataclass
class _History:
    steps: dict[int, Step] = field(default_factory=dict)
    now: dict[Path, bytes | None] = field(default_factory=dict)
    before: dict[Path, bytes | None] = field(default_factory=dict)  # as they were before the first step
    roots: set[Path] = field(default_factory=set)

    @property
    def number(self) -> int:
        """The current step of Blender's undo, the latest of all scenes; 0 before the first."""
        return max((scene.karf.marking.step for scene in bpy.data.scenes), default=0)

    @property
    def step(self) -> Step:
        return self.steps.get(self.number, Step())

    def write(self, files: Files) -> None:
        for path in files:  # no link may lead out of the root
            root = next((root for root in self.roots if path.is_relative_to(root)), path.parent)
            checked_path(root, *path.relative_to(root).parts)
        for path, content in files.items():
            if path not in self.before:
                self.before[path] = path.read_bytes() if path.is_file() else None
            if content is None:
                self._remove(path)
            else:
                atomic_write(path, lambda temporary, content=content: temporary.write_bytes(content))
            self.now[path] = content

    def _remove(self, path: Path) -> None:
        path.unlink(missing_ok=True)
        for parent in path.parents:
            # to the engine, an empty folder is an object without a mask
            if parent in self.roots or not parent.is_dir() or any(parent.iterdir()):
                return
            parent.rmdir()


def note() -> Any:
    """Return the note of the current step."""
    return session.get(_History).step.note


def record(scene: bpy.types.Scene, root: Path, files: Files, note: Any = None) -> int:
    """Write files below a root folder as a new step, whose number is returned. Raises OSError, and makes no step."""
    history = session.get(_History)
    history.roots.add(root)
    history.write(files)
    made = max(history.steps, default=0) + 1
    history.steps[made] = Step(dict(history.now), note)
    scene.karf.marking.step = made
    return made


def amend(step: int, files: Files) -> bool:
    """Add files to their step later; if it is the current one, write them and return True. May raise OSError."""
    history = session.get(_History)
    if step not in history.steps:
        return False
    if step == history.number:
        history.write(files)
    known = history.steps[step]
    history.steps[step] = Step({**known.files, **files}, known.note)
    return step == history.number


def follow() -> None:
    """Write the files of the current step after undo or redo. Raises OSError if a file cannot be written."""
    history = session.get(_History)
    files = {**history.before, **history.step.files}
    history.write({path: content for path, content in files.items() if content != history.now.get(path)})


@session.handler("load_post", phase=session.Phase.READ)
def forget(*_) -> None:
    """Drop all steps; the files stay as they are."""
    for known in vars(session.get(_History)).values():
        known.clear()
    for scene in bpy.data.scenes:
        if scene.karf.marking.step:
            scene.karf.marking.step = 0
