"""Traps in a process: let something happen at the n-th time that it changes a file below a folder."""

from __future__ import annotations

import errno
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path

CHANGES = ("os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.truncate", "os.link", "os.symlink")
MAKING = os.O_CREAT | os.O_TRUNC


def file_events(folder: Path, act: Callable[[str], None], flushes: bool) -> Callable[[], None]:
    """What to call in a process so that `act(event)` is called just before each change of a file in the folder.

    A change is a file that is made or emptied, a rename, a removal, a new folder, and with `flushes` a file's flush.
    """
    root = str(folder)

    def hook(event: str, arguments: tuple) -> None:
        makes = event == "open" and isinstance(arguments[2], int) and arguments[2] & MAKING
        if event not in CHANGES and not makes:
            return
        path = os.fsdecode(arguments[0]) if isinstance(arguments[0], str | bytes | os.PathLike) else ""
        vain = {"os.mkdir": True, "os.remove": False}.get(event)  # what is there already, or no longer
        if path.startswith(root) and (vain is None or os.path.lexists(path) != vain):
            act(f"{event} {Path(path).suffix or Path(path).name}")

    def set_up() -> None:
        flush = os.fsync

        def flushed(handle) -> None:
            act("fsync")
            flush(handle)

        if flushes:
            os.fsync = flushed
        sys.addaudithook(hook)

    return set_up


def recorder(handle: int) -> Callable[[str], None]:
    """Write the events' names to an open file, one a line."""
    return lambda event: os.write(handle, f"{event}\n".encode()) and None


def at(number: int, act: Callable[[], None]) -> Callable[[str], None]:
    """Call `act` at the event of this number, counted from 1."""
    count = 0

    def counted(event: str) -> None:
        nonlocal count
        count += 1
        if count == number:
            act()

    return counted


def from_then_on(number: int, act: Callable[[], None]) -> Callable[[str], None]:
    """Call `act` at the event of this number and at each after it that needs room: a removal needs none."""
    count = 0

    def counted(event: str) -> None:
        nonlocal count
        count += 1
        if count >= number and not event.startswith(("os.remove", "os.rmdir")):
            act()

    return counted


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def no_room() -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
