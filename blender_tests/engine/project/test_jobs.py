"""Folders of jobs: the newest stay for their logs, those of no use any more go, and nothing else is touched."""

import json
import os
import subprocess
import sys

import pytest

from karf_engine.io.files import host_name
from karf_engine.project import Project, jobs

KEPT = [f"20250101-000000-{number:03d}-render" for number in range(jobs.KEPT)]


@pytest.fixture(scope="module")
def ended():
    """What a job of a process that has ended says of its owner."""
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return {"pid": process.pid, "host": host_name()}


def make(project, *folders, owner=None):
    for name in folders:
        job = project.folder / "jobs" / name
        job.mkdir(parents=True)
        (job / "engine.log").write_text("started")
        if owner is not None:
            (job / jobs.OWNER_FILE).write_text(json.dumps(owner))


def names(project):
    return sorted(path.name for path in (project.folder / "jobs").iterdir())


def test_the_newest_stay_and_a_new_job_belongs_to_this_process(project, ended):
    make(project, *KEPT, "20241231-235959-000-geometry", owner=ended)
    make(project, "20241231-235959-001-import-splat")  # of an earlier version
    jobs.prune_jobs(project)
    assert names(project) == KEPT
    new = jobs.new_job(project, "render"), jobs.new_job(project, "warm")
    assert names(project) == sorted([*KEPT[1:], *(job.name for job in new)])
    for job in new:
        assert [path.name for path in job.iterdir()] == [jobs.OWNER_FILE]
    jobs.prune_jobs(project)
    assert all(job.is_dir() for job in new)


@pytest.mark.parametrize("year", [2024, 2026], ids=["old", "new"])
@pytest.mark.parametrize(
    ("owner", "stays"),
    [
        ({"pid": os.getpid()}, True),
        ({"pid": os.getppid()}, True),
        ({}, False),
        ({"host": "another computer"}, True),
        ({"pid": "x"}, True),
        ({"pid": 1 << 80}, False),
        ([], True),
    ],
)
def test_what_answered_queries_goes_with_its_process(project, ended, owner, stays, year):
    make(project, *KEPT)
    name = f"{year}0101-000000-000-warm"
    make(project, name, owner=ended | owner if isinstance(owner, dict) else owner)
    jobs.prune_jobs(project)
    assert (name in names(project)) is stays


def test_what_is_no_job_stays(project, ended, tmp_path):
    others = ["notes", "20240101-000000-000-warm.old", "20240101-000000-00-warm", "my-20240101-000000-000-warm"]
    make(project, *KEPT)
    make(project, *others, owner=ended)
    elsewhere = Project(tmp_path / "elsewhere")
    make(elsewhere, "20240101-000000-000-warm", owner=ended)
    link = project.folder / "jobs" / "20240101-000000-000-render"
    link.symlink_to(elsewhere.folder / "jobs" / "20240101-000000-000-warm", target_is_directory=True)
    file = project.folder / "jobs" / "20240101-000000-001-render"
    file.touch()
    jobs.prune_jobs(project)
    assert names(project) == sorted([*KEPT, *others, link.name, file.name])
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "jobs").symlink_to(elsewhere.folder / "jobs", target_is_directory=True)
    jobs.prune_jobs(Project(tmp_path / "other"))
    assert names(elsewhere) == ["20240101-000000-000-warm"]
