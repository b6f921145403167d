"""One job writes a project at a time, and the operating system frees what a killed one held."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("filelock")

from karf_engine.errors import BadRequest
from karf_engine.project import Project
from karf_engine.project.locking import write_lock

ROOT = Path(__file__).resolve().parents[3]
HOLD = """
import sys
sys.path.insert(0, sys.argv[1])
from karf_engine.project.locking import write_lock
from karf_engine.project import Project
with write_lock(Project(sys.argv[2])):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def project(tmp_path):
    project = Project(tmp_path / "project")
    project.create("/captures/pots")
    return project


@pytest.fixture
def hold(project):
    """Start a process that holds the project's lock."""
    children = []

    def start():
        child = subprocess.Popen(
            [sys.executable, "-c", HOLD, str(ROOT), str(project.folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        children.append(child)
        assert child.stdout.readline() == "held\n"
        return child

    yield start
    for child in children:
        child.kill()
        child.communicate()


def test_a_project_that_another_process_writes_is_refused_with_its_number(project, hold):
    child = hold()
    with pytest.raises(BadRequest, match=f"in use by process {child.pid} on"), write_lock(project):
        pass


def test_what_a_killed_process_held_is_free(project, hold):
    child = hold()
    child.kill()
    child.wait()
    with write_lock(project):
        assert json.loads((project.folder / "lock.json").read_text())["pid"] == os.getpid()
    assert not (project.folder / "lock.json").exists()


def test_the_lock_is_given_back_after_an_error_and_is_not_entered_twice(project):
    with pytest.raises(RuntimeError), write_lock(project):
        with pytest.raises(BadRequest, match=f"in use by process {os.getpid()}"), write_lock(project):
            pass
        raise RuntimeError
    with write_lock(project):
        pass


@pytest.mark.parametrize("content", ["", "{", json.dumps({"pid": os.getpid(), "start": "1", "host": "elsewhere"})])
def test_a_lock_file_that_nobody_holds_is_no_obstacle_whatever_it_says_and_when(project, content):
    path = project.folder / "lock"
    path.write_text(content)
    os.utime(path, (time.time() + 1e6,) * 2)
    with write_lock(project):
        pass


def test_a_holder_that_could_not_say_who_it_is_still_holds(project, hold):
    hold()
    (project.folder / "lock.json").write_text("{")
    with pytest.raises(BadRequest, match="in use by another job"), write_lock(project):
        pass
