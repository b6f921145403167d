"""Locks of a project: one job writes, and readers never see half of a stage's outputs.

Both are locks of the operating system, which frees them when their process ends, however it ends. On network drives
without such locks the library falls back to a file with the owner's process and host, and checks whether it is alive.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from ..errors import BadRequest
from ..io.files import write_json
from . import Project

COMMIT_SECONDS = 60.0  # wait for a commit: it renames a few files, which may take a while on a slow network drive


@contextmanager
def writing(project: Project) -> Iterator[None]:
    """Hold the project for one job that writes, cleared of what killed ones left.

    Raises:
        BadRequest: Another job holds it.
    """
    holder = project.folder / "lock.json"
    lock = FileLock(project.folder / "lock", timeout=0)
    try:
        lock.acquire()
    except Timeout:
        raise BadRequest(
            "{folder} is in use by {name}.",
            "Wait for that job or cancel it.",
            folder=project.folder,
            name=_name(holder),
        ) from None
    try:
        project.remove_leftovers()
        write_json(holder, {"pid": os.getpid(), "host": platform.node()})
        yield
    finally:
        with suppress(OSError):  # only a name for messages
            holder.unlink(missing_ok=True)
        lock.release()


def opened(folder: Path | str) -> Project:
    """The project in a folder, after a commit that was interrupted is completed.

    Raises:
        BadRequest: There is one to complete, and another job holds the project.
    """
    project = Project(folder)
    if project.is_interrupted:
        with writing(project), consistent(project):
            project.recover()
    return project


@contextmanager
def consistent(project: Project) -> Iterator[None]:
    """Keep a project's outputs as they are while several are read, or replaced.

    Where no lock can be made, as on a read-only disk, nothing can be replaced either, and none is needed.

    Raises:
        BadRequest: Another job holds the lock for more than `COMMIT_SECONDS`.
    """
    lock = FileLock(project.folder / "commit.lock", timeout=COMMIT_SECONDS)
    with suppress(OSError):
        try:
            lock.acquire()
        except Timeout:
            raise BadRequest(f"{project.folder} is being changed by another job.", "Try again.") from None
    try:
        yield
    finally:
        lock.release()


def _name(holder: Path) -> str:
    """The process that holds a project, for messages."""
    try:
        content = json.loads(holder.read_text(encoding="utf-8"))
        return f"process {int(content['pid'])} on {content['host']}"
    except (OSError, ValueError, KeyError, TypeError):  # it is being written, or its owner could not write
        return "another job"
