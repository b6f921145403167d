"""The folders of jobs, `jobs/<time>-<number>-<stage>`: each says whose it is, and those of no use any more are removed."""

from __future__ import annotations

import os
import re
import shutil
from contextlib import suppress
from pathlib import Path

from ..errors import KarfError
from ..io.containment import is_link
from ..io.files import read_json, write_json
from ..io.processes import host_name, is_running
from .folder import Project

KEPT = 20  # the newest, for their logs
NAME = re.compile(r"\d{8}-\d{6}-\d{3}-[a-z-]+")  # as `Project.new_job` makes them
OWNER_FILE = "owner.json"
ANSWERING = "-warm"  # of the stage that answers queries, whose folders are large


def new_job(project: Project, stage: str) -> Path:
    """Make an empty job folder that belongs to this process, once those of no use any more are removed.

    Raises:
        OSError: The folder cannot be written.
    """
    prune_jobs(project)
    job = project.new_job(stage)
    write_json(job / OWNER_FILE, {"pid": os.getpid(), "host": host_name()})
    return job


def prune_jobs(project: Project) -> None:
    """Remove all job folders but the newest `KEPT`, and those that answered queries of a process that is gone.

    Folders of processes that run, or may run on another computer, stay; so does what has another name. Never raises.
    """
    with suppress(OSError, KarfError):
        root = project.path("jobs")
        jobs = sorted(path for path in root.iterdir() if NAME.fullmatch(path.name) and not is_link(path))
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
        return owner["host"] == host_name() and not is_running(int(owner["pid"]))
    except (KarfError, LookupError, TypeError, ValueError, OverflowError, OSError):
        return False
