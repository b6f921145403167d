"""The color book that the user has chosen, as read last, for drawing; what watches the disk calls `refresh`."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from .. import session
from ..engine_api import ColorBook, KarfError, Message, read_color_book
from .state import HAS_TIMER, current


class Known(NamedTuple):
    book: ColorBook | None = None  # if one is chosen
    problem: Message | str = ""  # why it cannot be read


@dataclass
class _State:
    key: tuple[str, int] = ("", 0)  # file and time
    known: Known = field(default_factory=Known)


def known() -> Known:
    if not HAS_TIMER:  # nothing else would read it
        refresh()
    return session.get(_State).known


def refresh() -> bool:
    """Read the book where another was chosen or its file has changed; True then. Never raises."""
    path = current().color_book
    key = path, _written(path)
    state = session.get(_State)
    if key == state.key:
        return False
    state.key, state.known = key, _read(path)
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
