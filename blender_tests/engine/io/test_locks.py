"""Locks where the file system has none: a lease with its holder, which ends when nobody renews it."""

import errno
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("filelock")

from filelock import SoftFileLease, Timeout

from karf_engine.io import locks
from karf_engine.io.locks import acquire

ROOT = Path(__file__).resolve().parents[3]
HOLD = """
import sys
sys.path.insert(0, sys.argv[1])
from blender_tests.engine.io.test_locks import refuse_locks
from karf_engine.io import locks
locks.FileLock.acquire = refuse_locks(int(sys.argv[3]))
locks.LEASE_SECONDS = 1.0
lock = locks.acquire(__import__("pathlib").Path(sys.argv[2]))
print("held", flush=True)
sys.stdin.read()
"""


def refuse_locks(number):
    def acquire(*_, **__):
        raise OSError(number, "no locks")

    return acquire


@pytest.fixture(params=[errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS])
def number(request, monkeypatch):
    """A file system without locks: the error that it gives."""
    monkeypatch.setattr(locks.FileLock, "acquire", refuse_locks(request.param))
    monkeypatch.setattr(locks, "LEASE_SECONDS", 1.0)
    return request.param


def test_a_lease_keeps_another_process_out_for_as_long_as_it_runs(number, tmp_path):
    child = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(ROOT), str(tmp_path / "lock"), str(number)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert child.stdout.readline() == "held\n"
    with pytest.raises(Timeout):
        acquire(tmp_path / "lock")
    child.kill()
    child.communicate()
    lock = acquire(tmp_path / "lock")
    assert isinstance(lock, SoftFileLease)
    lock.release()


def test_a_lease_that_came_with_a_copy_of_the_project_ends(number, tmp_path):
    held = acquire(tmp_path / "lock")
    (tmp_path / "copy").mkdir()
    shutil.copy(tmp_path / "lock.lease", tmp_path / "copy" / "lock.lease")
    start = time.monotonic()
    acquire(tmp_path / "copy" / "lock").release()
    held.release()
    assert time.monotonic() - start < 10


def test_other_errors_are_no_reason_for_a_lease(monkeypatch, tmp_path):
    monkeypatch.setattr(locks.FileLock, "acquire", refuse_locks(errno.EACCES))
    with pytest.raises(PermissionError):
        acquire(tmp_path / "lock")
