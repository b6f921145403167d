"""Locks of a project: only one job writes, and readers never see half of a stage's outputs."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import Timeout

from ..errors import BadRequest, KarfError
from ..io.files import read_json, write_json
from ..io.locks import acquire
from . import Project

COMMIT_SECONDS = 60.0  # a commit renames a few files, which may take a while on a slow network drive


@contextmanager
def write_lock(project: Project) -> Iterator[None]:
    """Hold the lock for writing, and first delete the leftovers of killed jobs.

    Raises:
        BadRequest: Another job holds the lock.
    """
    holder = project.path("lock.json")
    _check_lease(project, "lock")
    try:
        lock = acquire(project.path("lock"))
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
        with suppress(OSError):  # it only names the holder in messages
            holder.unlink(missing_ok=True)
        lock.release()


def open_project(folder: Path | str) -> Project:
    """Open the project in a folder and complete an interrupted commit.

    Raises:
        BadRequest: A commit was interrupted, and another job holds the lock for writing.
    """
    project = Project(folder)
    if project.is_interrupted:
        with write_lock(project), read_lock(project):
            project.recover()
    return project


@contextmanager
def read_lock(project: Project) -> Iterator[None]:
    """Keep a project's outputs unchanged while several are read or replaced.

    A read-only disk takes no lock and needs none.

    Raises:
        BadRequest: Another job holds the lock for more than `COMMIT_SECONDS`.
    """
    _check_lease(project, "commit.lock")
    lock = None
    try:
        lock = acquire(project.path("commit.lock"), COMMIT_SECONDS)
    except Timeout:
        raise BadRequest(f"{project.folder} is being changed by another job.", "Try again.") from None
    except OSError:
        pass
    try:
        yield
    finally:
        if lock:
            lock.release()


def _check_lease(project: Project, name: str) -> None:
    """Raise DataError where a lock's lease is a link."""
    project.path(f"{name}.lease")


def _name(holder: Path) -> str:
    """Return the process that holds the lock, for messages."""
    try:
        content = read_json(holder, "lock")
        return f"process {int(content['pid'])} on {content['host']}"
    except (KarfError, OSError, ValueError, KeyError, TypeError):  # half-written or missing
        return "another job"
