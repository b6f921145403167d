"""The folders of jobs, `jobs/<time>-<number>-<stage>`: each says whose it is, and those of no use any more are removed."""

from __future__ import annotations

import ctypes
import os
import platform
import re
import shutil
from contextlib import suppress
from pathlib import Path

from ..errors import KarfError
from ..io.files import read_json, write_json
from .folder import Project

KEPT = 20  # the newest, for their logs
NAME = re.compile(r"\d{8}-\d{6}-\d{3}-[a-z-]+")  # as `Project.new_job` makes them
OWNER_FILE = "owner.json"
ANSWERING = "-warm"  # of the stage that answers queries, whose folders are large
SYNCHRONIZE, NO_SUCH_PROCESS, STILL_RUNS = 0x100000, 87, 0x102  # of Windows


def new_job(project: Project, stage: str) -> Path:
    """Make an empty job folder that belongs to this process, once those of no use any more are removed.

    Raises:
        OSError: The folder cannot be written.
    """
    prune_jobs(project)
    job = project.new_job(stage)
    write_json(job / OWNER_FILE, {"pid": os.getpid(), "host": _host()})
    return job


def prune_jobs(project: Project) -> None:
    """Remove all job folders but the newest `KEPT`, and those that answered queries of a process that is gone.

    Folders of processes that run, or may run on another computer, stay; so does what has another name. Never raises.
    """
    root = project.folder / "jobs"
    with suppress(OSError):
        if root.resolve() != project.folder.resolve() / "jobs":  # a link
            return
        jobs = sorted(path for path in root.iterdir() if NAME.fullmatch(path.name) and not path.is_symlink())
        for age, job in enumerate(reversed(jobs)):
            is_left = job.name.endswith(ANSWERING) and (job / OWNER_FILE).exists()
            if (age >= KEPT or is_left) and _is_over(job):
                shutil.rmtree(job, ignore_errors=True)


def _is_over(job: Path) -> bool:
    """Whether the process that a job belongs to is gone; earlier versions did not note it."""
    if not (job / OWNER_FILE).exists():
        return True
    try:
        owner = read_json(job / OWNER_FILE, "job's owner")
        return owner["host"] == _host() and not _runs(int(owner["pid"]))
    except (KarfError, LookupError, TypeError, ValueError, OverflowError, OSError):
        return False


def _host() -> str:
    """The name of this computer, on Linux with that of the container in which process numbers count."""
    with suppress(OSError):
        return f"{platform.node()} {Path('/proc/self/ns/pid').readlink()}"
    return platform.node()


def _runs(pid: int) -> bool:
    """Whether a process of this computer runs."""
    if os.name == "nt":  # where `os.kill` would end it
        kernel = ctypes.WinDLL("kernel32", use_last_error=True)
        handle = kernel.OpenProcess(SYNCHRONIZE, False, pid)
        if not handle:
            return ctypes.get_last_error() != NO_SUCH_PROCESS
        runs = kernel.WaitForSingleObject(handle, 0) == STILL_RUNS
        kernel.CloseHandle(handle)
        return runs
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # another user's
        return True
    return True
