"""Child processes with limits return arrays or a readable error; a lease replaces unsupported file locks."""

import errno
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from filelock import SoftFileLease, Timeout

from blender_tests.engine.conftest import ROOT
from karf_engine.errors import DataError, MissingDependency, missing_extra
from karf_engine.io import limited, locks
from karf_engine.io.limited import run_limited
from karf_engine.io.locks import acquire

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="memory is limited and /proc exists on Linux alone")
HERE = f"import sys; sys.path.insert(0, {str(ROOT)!r}); from {__name__} import *; path = Path(sys.argv[1]); "


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


def test_child_returns_arrays_in_order_and_passes_errors_on(file):
    two, one = run_limited(two_arrays, file, ("two", "one"))
    assert str(two) == "content" and one.tolist() == [0, 1, 2]
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
def test_any_end_of_the_child_is_reported_about_the_file(work, words, file, monkeypatch):
    monkeypatch.setattr(limited, "LEAST_SECONDS", 1)
    monkeypatch.setattr(limited, "PATIENCE", 2 if work is idle else 60)
    with pytest.raises(DataError, match=words) as caught:
        run_limited(work, file, ("one",))
    assert str(file) in caught.value.sentence


def wait_until(is_so, seconds=60):
    until = time.monotonic() + seconds
    while not is_so() and time.monotonic() < until:
        time.sleep(0.05)
    assert is_so()


@LINUX
def test_child_ends_with_its_parent(file):
    parent = subprocess.Popen([sys.executable, "-c", HERE + "run_limited(idle, path, ())", file])
    pid = file.with_name("pid")
    wait_until(lambda: pid.exists() and pid.read_text())
    parent.kill()
    parent.wait()
    wait_until(lambda: not Path("/proc", pid.read_text()).exists(), 5)


def without_locks(number, patch=setattr):
    """Simulate a file system that gives this error, with leases that expire soon."""

    def refuse(*_, **__):
        raise OSError(number, "no locks")

    patch(locks.FileLock, "acquire", refuse)
    patch(locks, "LEASE_SECONDS", 1.0)


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS])
def test_lease_replaces_unsupported_locks_and_expires_in_a_copy(number, tmp_path, monkeypatch):
    without_locks(number, monkeypatch.setattr)
    held = acquire(tmp_path / "lock")
    assert isinstance(held, SoftFileLease)
    (tmp_path / "copy").mkdir()
    shutil.copy(tmp_path / "lock.lease", tmp_path / "copy" / "lock.lease")
    start = time.monotonic()
    acquire(tmp_path / "copy" / "lock").release()
    held.release()
    assert time.monotonic() - start < 10


def test_lease_excludes_other_processes_while_its_holder_runs(tmp_path, monkeypatch):
    without_locks(errno.ENOLCK, monkeypatch.setattr)
    hold = "without_locks(errno.ENOLCK); lock = acquire(path); print('held', flush=True); input()"
    command = [sys.executable, "-c", HERE + hold, str(tmp_path / "lock")]
    child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "held\n"
    with pytest.raises(Timeout):
        acquire(tmp_path / "lock")
    child.kill()
    child.communicate()
    acquire(tmp_path / "lock").release()


def test_other_errors_do_not_lead_to_a_lease(tmp_path, monkeypatch):
    without_locks(errno.EACCES, monkeypatch.setattr)
    with pytest.raises(PermissionError):
        acquire(tmp_path / "lock")
