"""Folders of jobs: the newest stay for their logs, those of no use any more go, and nothing else is touched."""

import json
import os
import subprocess
import sys

import pytest

from karf_engine.io.files import host_name
from karf_engine.project import Project, jobs

KEPT = [f"20250101-000000-{number:03d}-render" for number in range(jobs.KEPT)]


@pytest.fixture
def project(tmp_path):
    project = Project(tmp_path / "project")
    project.create("/captures/pots")
    return project


@pytest.fixture(scope="module")
def ended_pid():
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def make(project, name, owner=None):
    job = project.folder / "jobs" / name
    job.mkdir(parents=True)
    (job / "engine.log").write_text("started")
    if owner is not None:
        (job / jobs.OWNER_FILE).write_text(json.dumps(owner))
    return job


def names(project):
    return sorted(path.name for path in (project.folder / "jobs").iterdir())


def owner_of(pid, host=""):
    return {"pid": pid, "host": host or host_name()}


def test_the_newest_stay(project, ended_pid):
    for name in KEPT:
        make(project, name, owner_of(ended_pid))
    make(project, "20241231-235959-000-geometry", owner_of(ended_pid))
    make(project, "20241231-235959-001-import-splat")  # of an earlier version
    jobs.prune_jobs(project)
    assert names(project) == KEPT
    job = jobs.new_job(project, "render")
    assert names(project) == sorted([*KEPT, job.name])
    assert jobs.new_job(project, "render").is_dir() and names(project)[0] == KEPT[1]


@pytest.mark.parametrize("age", ["old", "new"])
@pytest.mark.parametrize(
    "owner, stays",
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
def test_what_answered_queries_goes_with_its_process(project, ended_pid, owner, stays, age):
    for name in KEPT:
        make(project, name)
    known = owner_of(ended_pid) | owner if isinstance(owner, dict) else owner
    job = make(project, f"20{'24' if age == 'old' else '26'}0101-000000-000-warm", known)
    jobs.prune_jobs(project)
    assert job.exists() is stays


def test_what_is_no_job_stays(project, ended_pid, tmp_path):
    for name in KEPT:
        make(project, name)
    outside = tmp_path / "films" / "20240101-000000-000-warm"
    outside.mkdir(parents=True)
    (outside / jobs.OWNER_FILE).write_text(json.dumps(owner_of(ended_pid)))
    others = ["notes", "20240101-000000-000-warm.old", "20240101-000000-00-warm", "my-20240101-000000-000-warm"]
    for name in others:
        make(project, name, owner_of(ended_pid))
    link = project.folder / "jobs" / "20240101-000000-000-render"
    link.symlink_to(outside, target_is_directory=True)
    file = project.folder / "jobs" / "20240101-000000-001-render"
    file.touch()
    jobs.prune_jobs(project)
    assert names(project) == sorted([*KEPT, *others, link.name, file.name]) and outside.is_dir()


def test_jobs_that_lie_elsewhere_stay(project, ended_pid, tmp_path):
    other = Project(tmp_path / "other")
    job = make(other, "20240101-000000-000-warm", owner_of(ended_pid))
    (project.folder / "jobs").symlink_to(other.folder / "jobs", target_is_directory=True)
    jobs.prune_jobs(project)
    assert job.is_dir()


def test_a_new_job_belongs_to_this_process(project):
    job = jobs.new_job(project, "warm")
    assert [path.name for path in job.iterdir()] == [jobs.OWNER_FILE]
    jobs.prune_jobs(project)
    assert job.is_dir()
