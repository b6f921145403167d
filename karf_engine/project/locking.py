"""The lock of a project: only one job writes. Readers need none, see `Project.snapshot`."""

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


@contextmanager
def write_lock(project: Project) -> Iterator[None]:
    """Hold the lock for writing, and first delete the leftovers of killed jobs. Raises BadRequest if another job has it."""
    holder = project.path("lock.json")
    project.path("lock.lease")  # refuse links
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


def _name(holder: Path) -> str:
    """Return the process that holds the lock, for messages."""
    try:
        content = read_json(holder, "lock")
        return f"process {int(content['pid'])} on {content['host']}"
    except (KarfError, OSError, ValueError, KeyError, TypeError):  # half-written or missing
        return "another job"
