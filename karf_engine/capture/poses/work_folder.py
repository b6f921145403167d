"""Temporary work folders; those of killed processes are removed by the next one."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import Timeout

from ...io.locks import acquire

LOCK = ".karf-work"  # lock file, released by the system when the process ends
YOUNG = 10.0  # seconds; the owner of a newer folder may not have locked it yet


@contextmanager
def work_folder(parent: Path, prefix: str) -> Iterator[Path]:
    """Create a folder in `parent` whose name begins with `prefix`, and remove it at the end of the block."""
    _remove_leftovers(parent, prefix)
    folder = Path(tempfile.mkdtemp(prefix=prefix, dir=parent))
    try:
        lock = acquire(folder / LOCK)
        try:
            yield folder
        finally:
            lock.release()
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _remove_leftovers(parent: Path, prefix: str) -> None:
    """Remove the work folders of processes that have ended."""
    for folder in parent.iterdir():
        lock = folder / LOCK
        if not folder.name.startswith(prefix) or folder.is_symlink() or not lock.is_file():
            continue
        if time.time() - lock.stat().st_mtime < YOUNG:
            continue
        try:
            acquire(lock).release()
        except (Timeout, OSError):  # in use, or of another user
            continue
        shutil.rmtree(folder, ignore_errors=True)
