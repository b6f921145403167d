"""The color book that the user has chosen, as it was read last: drawing asks only this.

Whoever watches the disk calls `refresh`, and so does the choice of another file. In background mode nothing is drawn and
timers never fire: there every question looks at the file.
"""

from pathlib import Path
from typing import NamedTuple

import bpy

from ..engine_api import ColorBook, KarfError, Message, read_color_book
from . import choices

HAS_TIMER = not bpy.app.background


class Known(NamedTuple):
    """The book; None where none is chosen, or why it cannot be read."""

    book: ColorBook | None = None
    problem: Message | str = ""


class _Memory:
    """What was read last, and of which file and time."""

    key: tuple[str, int] = ("", 0)
    known: Known = Known()


def known() -> Known:
    """The chosen book as it was read last."""
    if not HAS_TIMER:
        refresh()
    return _Memory.known


def refresh() -> bool:
    """Read the book where another was chosen or its file has changed; True then. Never raises."""
    path = choices.current().color_book
    key = path, _written(path)
    if key == _Memory.key:
        return False
    _Memory.key, _Memory.known = key, _read(path)
    return True


def _written(path: str) -> int:
    try:
        return Path(path).stat().st_mtime_ns if path else 0
    except (OSError, ValueError):  # gone, or a name that no disk can hold
        return 0


def _read(path: str) -> Known:
    if not path:
        return Known()
    try:
        return Known(read_color_book(path))
    except KarfError as error:
        return Known(problem=error.message)


def forget() -> None:
    """Called when the extension is disabled."""
    _Memory.key, _Memory.known = ("", 0), Known()
