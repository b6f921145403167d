"""Make and prune job folders, `jobs/<time>-<number>-<stage>`."""

from __future__ import annotations

import os
import re
import shutil
from contextlib import suppress
from pathlib import Path

from ..errors import KarfError
from ..io.containment import is_link
from ..io.files import host_name, is_running, read_json, write_json
from .folder import Project

KEPT = 20  # newest jobs, for their logs
NAME = re.compile(r"\d{8}-\d{6}-\d{3}-[a-z-]+")  # of `Project.new_job`
OWNER_FILE = "owner.json"
WARM_SUFFIX = "-warm"  # of jobs that answer queries, whose folders are large


def new_job(project: Project, stage: str) -> Path:
    """Prune old job folders, then make an empty one that belongs to this process. Raises OSError if that fails."""
    prune_jobs(project)
    job = project.new_job(stage)
    write_json(job / OWNER_FILE, {"pid": os.getpid(), "host": host_name()})
    return job


def prune_jobs(project: Project) -> None:
    """Remove all job folders but the newest `KEPT`, and the folders of `warm` jobs of processes that have ended.

    Folders with other names, or of processes that run or may run on another computer, stay. Never raises.
    """
    with suppress(OSError, KarfError):
        root = project.path("jobs")
        jobs = sorted(path for path in root.iterdir() if NAME.fullmatch(path.name) and not is_link(path))
        for age, job in enumerate(reversed(jobs)):
            is_warm = job.name.endswith(WARM_SUFFIX) and (job / OWNER_FILE).exists()
            if (age >= KEPT or is_warm) and _has_ended(job):
                shutil.rmtree(job, ignore_errors=True)


def _has_ended(job: Path) -> bool:
    """Return whether the job's process has ended; earlier versions did not record it."""
    if not (job / OWNER_FILE).exists():
        return True
    try:
        owner = read_json(job / OWNER_FILE, "job's owner")
        return owner["host"] == host_name() and not is_running(int(owner["pid"]))
    except (KarfError, LookupError, TypeError, ValueError, OverflowError, OSError):
        return False
