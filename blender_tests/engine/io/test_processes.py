"""A child process with limits gives its arrays or one sentence; a lease locks where the file system cannot."""

import errno
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("filelock")

from filelock import SoftFileLease, Timeout

from blender_tests.engine.conftest import ROOT
from karf_engine.errors import DataError, MissingDependency, missing_extra
from karf_engine.io import limited, locks
from karf_engine.io.limited import run_limited
from karf_engine.io.locks import acquire

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="elsewhere memory has no limit, and /proc is not there")


# works of the child
def two_arrays(path):
    return {"one": np.arange(3), "two": np.array(path.read_text())}


def refusing(path):
    raise missing_extra("gsply", "splats")


def failing(path):
    raise KeyError("it lacks a table")


def crashing(path):
    os.abort()


def greedy(path):
    bytearray(1 << 40)


def busy(path):
    while True:
        pass


def idle(path):
    path.with_name("pid").write_text(str(os.getpid()))
    time.sleep(600)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "füle\udcff.spz" if os.name != "nt" else tmp_path / "füle.spz"
    path.write_text("content")
    return path


def test_arrays_come_back_in_the_order_of_their_names(file):
    two, one = run_limited(two_arrays, file, ("two", "one"))
    assert str(two) == "content" and one.tolist() == [0, 1, 2]


def test_a_refusal_stays_as_it_is(file):
    with pytest.raises(MissingDependency) as caught:
        run_limited(refusing, file, ("one",))
    assert caught.value.hint.key == missing_extra("gsply", "splats").hint.key


@pytest.mark.parametrize(
    ("work", "words"),
    [
        (failing, "it lacks a table"),
        (crashing, "crashed or needed too much"),
        pytest.param(greedy, "takes more than .* bytes of memory", marks=LINUX),
        pytest.param(busy, "crashed or needed too much", marks=LINUX),
        (idle, "takes more than 2 s"),
    ],
)
def test_whatever_ends_the_child_is_a_sentence_about_the_file(work, words, file, monkeypatch):
    monkeypatch.setattr(limited, "LEAST_SECONDS", 1)
    monkeypatch.setattr(limited, "PATIENCE", 2 if work is idle else 60)
    with pytest.raises(DataError, match=words) as caught:
        run_limited(work, file, ("one",))
    assert str(file) in caught.value.sentence


@LINUX
def test_the_child_ends_with_its_parent(file):
    code = f"import sys; sys.path.insert(0, {str(ROOT)!r}); from pathlib import Path; from {__name__} import *; "
    parent = subprocess.Popen([sys.executable, "-c", code + "run_limited(idle, Path(sys.argv[1]), ())", file])
    pid = file.with_name("pid")
    while not (pid.exists() and pid.read_text()):
        time.sleep(0.05)
    parent.kill()
    parent.wait()
    until = time.monotonic() + 5
    while Path("/proc", pid.read_text()).exists() and time.monotonic() < until:
        time.sleep(0.05)
    assert not Path("/proc", pid.read_text()).exists()


HOLD = """
import errno, sys
sys.path.insert(0, sys.argv[1])
from pathlib import Path
from blender_tests.engine.io.test_processes import refuse_locks
from karf_engine.io import locks
locks.FileLock.acquire = refuse_locks(errno.ENOLCK)
locks.LEASE_SECONDS = 1.0
lock = locks.acquire(Path(sys.argv[2]))
print("held", flush=True)
sys.stdin.read()
"""


def refuse_locks(number):
    def acquire(*_, **__):
        raise OSError(number, "no locks")

    return acquire


@pytest.fixture
def without_locks(monkeypatch):
    """A file system that gives this error, and leases that end soon."""
    monkeypatch.setattr(locks, "LEASE_SECONDS", 1.0)
    return lambda number: monkeypatch.setattr(locks.FileLock, "acquire", refuse_locks(number))


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS])
def test_where_there_are_no_locks_a_lease_is_taken(without_locks, number, tmp_path):
    without_locks(number)
    lock = acquire(tmp_path / "lock")
    assert isinstance(lock, SoftFileLease)
    lock.release()


def test_a_lease_keeps_another_process_out_for_as_long_as_it_runs(without_locks, tmp_path):
    without_locks(errno.ENOLCK)
    command = [sys.executable, "-c", HOLD, str(ROOT), str(tmp_path / "lock")]
    child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "held\n"
    with pytest.raises(Timeout):
        acquire(tmp_path / "lock")
    child.kill()
    child.communicate()
    acquire(tmp_path / "lock").release()


def test_a_lease_that_came_with_a_copy_of_the_project_ends(without_locks, tmp_path):
    without_locks(errno.ENOLCK)
    held = acquire(tmp_path / "lock")
    (tmp_path / "copy").mkdir()
    shutil.copy(tmp_path / "lock.lease", tmp_path / "copy" / "lock.lease")
    start = time.monotonic()
    acquire(tmp_path / "copy" / "lock").release()
    held.release()
    assert time.monotonic() - start < 10


def test_other_errors_are_no_reason_for_a_lease(without_locks, tmp_path):
    without_locks(errno.EACCES)
    with pytest.raises(PermissionError):
        acquire(tmp_path / "lock")
