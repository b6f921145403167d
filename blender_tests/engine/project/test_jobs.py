"""One job writes a project at a time; old job folders are pruned and nothing else."""

import json
import os
import subprocess
import sys
import time

import pytest

from blender_tests.engine.conftest import ROOT
from karf_engine.errors import BadRequest
from karf_engine.io.files import host_name
from karf_engine.project import Project, jobs
from karf_engine.project.locking import write_lock

HOLD = """
import sys
from karf_engine.project.locking import write_lock
from karf_engine.project import Project
with write_lock(Project(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_project_is_locked_until_the_writing_process_ends(project):
    command, pipe = [sys.executable, "-c", HOLD, project.folder], subprocess.PIPE
    with subprocess.Popen(command, cwd=ROOT, stdin=pipe, stdout=pipe, text=True) as holder:
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(BadRequest, match=f"in use by process {holder.pid} on"), write_lock(project):
            pass
        (project.folder / "lock.json").write_text("{")  # an unnamed holder still holds the lock
        with pytest.raises(BadRequest, match="in use by another job"), write_lock(project):
            pass
        holder.kill()
        holder.wait()
    with write_lock(project):
        assert json.loads((project.folder / "lock.json").read_text())["pid"] == os.getpid()
    assert not (project.folder / "lock.json").exists()


def test_lock_is_released_after_an_error_and_is_not_reentrant(project):
    with pytest.raises(RuntimeError), write_lock(project):
        with pytest.raises(BadRequest, match=f"in use by process {os.getpid()}"), write_lock(project):
            pass
        raise RuntimeError
    with write_lock(project):
        pass


@pytest.mark.parametrize("content", ["", "{", json.dumps({"pid": os.getpid(), "start": "1", "host": "elsewhere"})])
def test_lock_file_without_holder_is_ignored(project, content):
    path = project.folder / "lock"
    path.write_text(content)
    os.utime(path, (time.time() + 1e6,) * 2)
    with write_lock(project):
        pass


KEPT = [f"20250101-000000-{number:03d}-render" for number in range(jobs.KEPT)]
WARM = "20240101-000000-000-warm"


@pytest.fixture(scope="module")
def ended():
    """The owner that a job of an ended process names."""
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return {"pid": process.pid, "host": host_name()}


def make(project, *folders, owner=None):
    for name in folders:
        job = project.folder / "jobs" / name
        job.mkdir(parents=True)
        if owner is not None:
            (job / jobs.OWNER_FILE).write_text(json.dumps(owner))


def names(project):
    return sorted(path.name for path in (project.folder / "jobs").iterdir())


def test_newest_jobs_are_kept_and_new_ones_are_owned(project, ended):
    make(project, *KEPT, "20241231-235959-000-geometry", owner=ended)
    make(project, "20241231-235959-001-import-splat")  # without an owner, as earlier versions wrote it
    jobs.prune_jobs(project)
    assert names(project) == KEPT
    new = jobs.new_job(project, "render"), jobs.new_job(project, "warm")
    assert names(project) == sorted([*KEPT[1:], *(job.name for job in new)])
    assert all([path.name for path in job.iterdir()] == [jobs.OWNER_FILE] for job in new)
    jobs.prune_jobs(project)
    assert all(job.is_dir() for job in new)


OWNERS = [  # changes to an ended owner, or an owner; whether the job stays
    *(({"pid": os.getpid()}, True), ({"pid": os.getppid()}, True), ({}, False), ({"host": "another computer"}, True)),
    *(({"pid": "x"}, True), ({"pid": 1 << 80}, False), ([], True)),
]


@pytest.mark.parametrize("year", [2024, 2026], ids=["old", "new"])
@pytest.mark.parametrize(("owner", "stays"), OWNERS)
def test_query_jobs_are_removed_when_their_process_has_ended(project, ended, owner, stays, year):
    name = WARM.replace("2024", str(year))
    make(project, *KEPT)
    make(project, name, owner=ended | owner if isinstance(owner, dict) else owner)
    jobs.prune_jobs(project)
    assert (name in names(project)) is stays


def test_pruning_keeps_everything_else(project, ended, tmp_path):
    others = ["notes", f"{WARM}.old", "20240101-000000-00-warm", f"my-{WARM}"]
    make(project, *KEPT)
    make(project, *others, owner=ended)
    elsewhere, linked = Project(tmp_path / "elsewhere"), Project(tmp_path / "linked")
    make(elsewhere, WARM, owner=ended)
    link, file = (project.folder / "jobs" / f"20240101-000000-00{number}-render" for number in range(2))
    link.symlink_to(elsewhere.folder / "jobs" / WARM, target_is_directory=True)
    file.touch()
    linked.folder.mkdir()
    (linked.folder / "jobs").symlink_to(elsewhere.folder / "jobs", target_is_directory=True)
    for each in (project, linked):
        jobs.prune_jobs(each)
    assert names(project) == sorted([*KEPT, *others, link.name, file.name])
    assert names(elsewhere) == [WARM]
