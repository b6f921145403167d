"""Files of marks that follow Blender's undo.

Each stroke is a step: the scene keeps its number, which undo takes back, and this session keeps what every file held
after it. Undo and redo then bring the files to where that number says, byte for byte. What a file held before the first
stroke is kept too, so that a mask of the user's own comes back as it was.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy

from .. import session
from ..engine_api import atomic_write, checked_path

Files = Mapping[Path, bytes | None]  # contents; None: there is no such file


@dataclass(frozen=True)
class Step:
    """What holds after a stroke. files: all that were ever changed; note: what else must come back with it."""

    files: Files = field(default_factory=dict)
    note: Any = None


@dataclass
class _State:
    """All steps of this session by their numbers, what the changed files hold now, and what they held at first."""

    steps: dict[int, Step] = field(default_factory=dict)
    now: dict[Path, bytes | None] = field(default_factory=dict)
    before: dict[Path, bytes | None] = field(default_factory=dict)
    roots: set[Path] = field(default_factory=set)


def number() -> int:
    """The step that Blender's undo stands at: the latest of all scenes. 0 before the first."""
    return max((scene.karf.marking.step for scene in bpy.data.scenes), default=0)


def note() -> Any:
    """What was noted with the present step."""
    return session.get(_State).steps.get(number(), Step()).note


def record(scene: bpy.types.Scene, root: Path, files: Files, note: Any = None) -> int:
    """Write files as a new step.

    Args:
        scene: Its undo takes the step back.
        root: The folder they lie in; folders below it that become empty are removed.
        files: What is to be written; None removes a file.
        note: Kept with the step.

    Returns:
        The step's number.

    Raises:
        OSError: A file cannot be written; the step is not taken.
    """
    session.get(_State).roots.add(root)
    _write(files)
    made = max(session.get(_State).steps, default=0) + 1
    session.get(_State).steps[made] = Step(dict(session.get(_State).now), note)
    scene.karf.marking.step = made
    return made


def amend(step: int, files: Files) -> bool:
    """Put files that came later into a step that was made for them; True if it is the present one: then they are written.

    Raises:
        OSError: A file cannot be written.
    """
    if step not in session.get(_State).steps:
        return False
    is_now = step == number()
    if is_now:
        _write(files)
    known = session.get(_State).steps[step]
    session.get(_State).steps[step] = Step({**known.files, **files}, known.note)
    return is_now


def follow() -> None:
    """After undo or redo: write what the present step says.

    Raises:
        OSError: A file cannot be written.
    """
    wanted = session.get(_State).steps.get(number(), Step()).files
    files = {**session.get(_State).before, **wanted}
    _write({path: content for path, content in files.items() if content != session.get(_State).now.get(path)})


def forget() -> None:
    """Forget all steps: another file was opened. What lies on the disk stays."""
    for known in (
        session.get(_State).steps,
        session.get(_State).now,
        session.get(_State).before,
        session.get(_State).roots,
    ):
        known.clear()
    for scene in bpy.data.scenes:
        if scene.karf.marking.step:
            scene.karf.marking.step = 0


def _write(files: Files) -> None:
    for path in files:
        _check(path)
    for path, content in files.items():
        if path not in session.get(_State).before:
            session.get(_State).before[path] = path.read_bytes() if path.is_file() else None
        if content is None:
            _remove(path)
        else:
            atomic_write(path, lambda temporary, content=content: temporary.write_bytes(content))
        session.get(_State).now[path] = content


def _check(path: Path) -> None:
    """Raise DataError where a link on the way from a root to a file leads out of the root."""
    root = next((root for root in session.get(_State).roots if path.is_relative_to(root)), path.parent)
    checked_path(root, *path.relative_to(root).parts)


def _remove(path: Path) -> None:
    path.unlink(missing_ok=True)
    for parent in path.parents:
        # the engine takes an empty folder for an object without a mask
        if parent in session.get(_State).roots or not parent.is_dir() or any(parent.iterdir()):
            return
        parent.rmdir()
