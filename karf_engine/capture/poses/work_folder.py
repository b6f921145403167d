"""Folders for work files that do not outlive their process: what a killed one has left is removed by the next."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import Timeout

from ...io.locks import acquire

LOCK = ".karf-work"  # lock file held while the folder is worked in; the system releases it when the process ends
YOUNG = 10.0  # seconds in which a folder's maker may not hold its lock yet


@contextmanager
def work_folder(parent: Path, prefix: str) -> Iterator[Path]:
    """A new folder in `parent` whose name begins with `prefix`; removed at the end of the block."""
    _remove_left(parent, prefix)
    folder = Path(tempfile.mkdtemp(prefix=prefix, dir=parent))
    try:
        lock = acquire(folder / LOCK)
        try:
            yield folder
        finally:
            lock.release()
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _remove_left(parent: Path, prefix: str) -> None:
    """Remove such folders of processes that have ended, as far as this one may."""
    for folder in parent.iterdir():
        lock = folder / LOCK
        if not folder.name.startswith(prefix) or folder.is_symlink() or not lock.is_file():
            continue
        if time.time() - lock.stat().st_mtime < YOUNG:
            continue
        try:
            acquire(lock).release()
        except (Timeout, OSError):  # at work, or another user's
            continue
        shutil.rmtree(folder, ignore_errors=True)
