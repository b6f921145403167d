"""Files of marks that follow Blender's undo.

Each stroke is a step. The scene stores its number, which undo takes back; the session stores the contents of all
changed files after it. Undo and redo restore the files of the current number byte for byte; before the first stroke,
these are the user's own.
"""

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
    """The state after a stroke."""

    files: Files = field(default_factory=dict)  # all that were ever changed
    note: Any = None  # what else must come back with it


@dataclass
class _State:
    steps: dict[int, Step] = field(default_factory=dict)
    now: dict[Path, bytes | None] = field(default_factory=dict)
    before: dict[Path, bytes | None] = field(default_factory=dict)
    roots: set[Path] = field(default_factory=set)


def number() -> int:
    """Return the current step of Blender's undo, the latest of all scenes; 0 before the first."""
    return max((scene.karf.marking.step for scene in bpy.data.scenes), default=0)


def note() -> Any:
    """Return the note of the current step."""
    return session.get(_State).steps.get(number(), Step()).note


def record(scene: bpy.types.Scene, root: Path, files: Files, note: Any = None) -> int:
    """Write files below a root folder as a new step of the scene, remove folders that become empty, and return its number.

    Raises OSError, and makes no step, if a file cannot be written.
    """
    state = session.get(_State)
    state.roots.add(root)
    _write(files)
    made = max(state.steps, default=0) + 1
    state.steps[made] = Step(dict(state.now), note)
    scene.karf.marking.step = made
    return made


def amend(step: int, files: Files) -> bool:
    """Add files to their step later; write them and return True if it is the current one.

    Raises OSError if a file cannot be written.
    """
    known = session.get(_State).steps.get(step)
    if known is None:
        return False
    is_now = step == number()
    if is_now:
        _write(files)
    session.get(_State).steps[step] = Step({**known.files, **files}, known.note)
    return is_now


def follow() -> None:
    """Write the files of the current step after undo or redo. Raises OSError if a file cannot be written."""
    state = session.get(_State)
    files = {**state.before, **state.steps.get(number(), Step()).files}
    _write({path: content for path, content in files.items() if content != state.now.get(path)})


@session.handler("load_post", phase=session.Phase.READ)
def forget(*_) -> None:
    """Drop all steps; the files stay as they are."""
    for known in vars(session.get(_State)).values():
        known.clear()
    for scene in bpy.data.scenes:
        if scene.karf.marking.step:
            scene.karf.marking.step = 0


def _write(files: Files) -> None:
    state = session.get(_State)
    for path in files:  # no link may lead out of the root
        root = next((root for root in state.roots if path.is_relative_to(root)), path.parent)
        checked_path(root, *path.relative_to(root).parts)
    for path, content in files.items():
        if path not in state.before:
            state.before[path] = path.read_bytes() if path.is_file() else None
        if content is None:
            _remove(path)
        else:
            atomic_write(path, lambda temporary, content=content: temporary.write_bytes(content))
        state.now[path] = content


def _remove(path: Path) -> None:
    path.unlink(missing_ok=True)
    for parent in path.parents:
        # to the engine, an empty folder is an object without a mask
        if parent in session.get(_State).roots or not parent.is_dir() or any(parent.iterdir()):
            return
        parent.rmdir()
