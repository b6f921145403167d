"""One job writes a project at a time, and the operating system frees what a killed one held."""

import json
import os
import subprocess
import sys
import time

import pytest

pytest.importorskip("filelock")

from blender_tests.engine.conftest import ROOT
from karf_engine.errors import BadRequest
from karf_engine.project.locking import write_lock

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
def hold(project):
    """A process that holds the project's lock."""
    child = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(ROOT), str(project.folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert child.stdout.readline() == "held\n"
    yield child
    child.kill()
    child.communicate()


def test_a_project_that_another_process_writes_is_refused_and_free_once_that_is_killed(project, hold):
    with pytest.raises(BadRequest, match=f"in use by process {hold.pid} on"), write_lock(project):
        pass
    (project.folder / "lock.json").write_text("{")  # a holder that could not say who it is still holds
    with pytest.raises(BadRequest, match="in use by another job"), write_lock(project):
        pass
    hold.kill()
    hold.wait()
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
