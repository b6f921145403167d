"""Traps, set in a process before its work, that act when it changes a file below a folder.

A change makes, empties, renames or removes a file, makes a folder, or with `flushes` flushes a file.
"""

from __future__ import annotations

import itertools
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path

CHANGES = ("os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.truncate", "os.link", "os.symlink")
MAKING = os.O_CREAT | os.O_TRUNC
REMOVALS = ("os.remove", "os.rmdir")


def record_changes(folder: Path, record: Path, flushes: bool) -> None:
    """Write each change to a line of a record."""
    handle = os.open(record, os.O_CREAT | os.O_WRONLY | os.O_TRUNC)
    _at_each_change(folder, lambda event, _: os.write(handle, f"{event}\n".encode()), flushes)


def die_at_change(folder: Path, number: int) -> None:
    """Kill the process just before the change of this number, counted from 1."""
    count = itertools.count(1)
    _at_each_change(folder, lambda event, _: next(count) == number and os.kill(os.getpid(), signal.SIGKILL), False)


def refuse_changes(folder: Path, number: int | None, first: int = 1, names: bool = True) -> None:
    """Fail changes from the `first` on, except removals, with the system's error of this number (None: no memory).

    names: whether the error names the path, as system calls do; without it, flushes count as changes.
    """
    count = itertools.count(1)

    def act(event: str, path: str) -> None:
        if next(count) >= first and not event.startswith(REMOVALS):
            raise MemoryError if number is None else OSError(number, os.strerror(number), *([path] if names else []))

    _at_each_change(folder, act, flushes=not names)


def _at_each_change(folder: Path, act: Callable[[str, str], object], flushes: bool) -> None:
    root, flush = str(folder), os.fsync

    def hook(event: str, arguments: tuple) -> None:
        makes = event == "open" and isinstance(arguments[2], int) and arguments[2] & MAKING
        if event not in CHANGES and not makes:
            return
        path = os.fsdecode(arguments[0]) if isinstance(arguments[0], str | bytes | os.PathLike) else ""
        no_change = {"os.mkdir": True, "os.remove": False}.get(event)  # if the path exists
        if path.startswith(root) and (no_change is None or os.path.lexists(path) != no_change):
            act(f"{event} {Path(path).suffix or Path(path).name}", path)

    def flushed(handle) -> None:
        act("fsync", "")
        flush(handle)

    if flushes:
        os.fsync = flushed
    sys.addaudithook(hook)
