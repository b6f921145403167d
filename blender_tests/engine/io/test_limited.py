"""A child process with limits gives its arrays or one sentence, and never outlives its parent."""

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from blender_tests.engine.conftest import ROOT
from karf_engine.errors import DataError, MissingDependency, missing_extra
from karf_engine.io import limited
from karf_engine.io.limited import run_limited

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
