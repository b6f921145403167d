"""Work in a child process: its messages arrive in order, and its failure or death is told of."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("filelock")

from blender_tests.engine.conftest import ROOT
from karf_engine.capture.child_process import LOCK, child_messages, work_folder
from karf_engine.errors import KarfError


def count(send, task):
    for number in range(task):
        send("number", number)
    return "all told"


def fail(send, task):
    raise ValueError(task)


def die(send, task):
    os._exit(task)


def sleep(send, task):
    time.sleep(task)


def test_messages_arrive_in_order_and_the_result_is_last():
    with child_messages("counting", count, 3) as messages:
        told = [message for message in messages if message[0]]
    assert told == [("number", 0), ("number", 1), ("number", 2), ("result", "all told")]


@pytest.mark.parametrize(("work", "task", "words"), [(fail, "no film", "no film"), (die, 7, "exit code 7")])
def test_a_child_that_fails_or_dies_is_told_of(work, task, words):
    with pytest.raises(KarfError, match=words), child_messages("the camera", work, task) as messages:
        list(messages)


def test_leaving_early_ends_the_child():
    start = time.monotonic()
    with child_messages("sleeping", sleep, 600) as messages:
        assert next(messages)[0] == ""
    assert time.monotonic() - start < 60


def note_and_sleep(send, task):
    Path(task).write_text(str(os.getpid()))
    time.sleep(600)


PARENT = """
import sys
from blender_tests.engine.capture.test_child_process import note_and_sleep
from karf_engine.capture.child_process import child_messages
if __name__ == "__main__":
    with child_messages("sleeping", note_and_sleep, sys.argv[1]) as messages:
        for _ in messages:
            pass
"""


def test_a_child_ends_when_its_parent_is_killed(tmp_path):
    note = tmp_path / "pid"
    (tmp_path / "parent.py").write_text(PARENT)
    parent = subprocess.Popen(
        [sys.executable, tmp_path / "parent.py", note], env=os.environ | {"PYTHONPATH": str(ROOT)}
    )
    wait_for(lambda: note.exists() and note.read_text())
    child = int(note.read_text())
    assert is_alive(child)
    parent.kill()
    parent.wait()
    wait_for(lambda: not is_alive(child))


def is_alive(pid):
    """Whether the process runs; one that has ended and that nobody waited for is none."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait_for(condition):
    end = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


LEAVING = """
import os, sys
from pathlib import Path
from karf_engine.capture.child_process import work_folder
with work_folder(Path(sys.argv[1]), "work-") as folder:
    (folder / "large.db").write_text("x")
    os.kill(os.getpid(), 9)
"""


def test_what_a_killed_process_has_left_is_removed_by_the_next(tmp_path):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, "-c", LEAVING, str(tmp_path)], env=environment, timeout=60)
    (left,) = tmp_path.glob("work-*")
    (tmp_path / "work-of_somebody_else").mkdir()
    os.utime(left / LOCK, (0, 0))
    with work_folder(tmp_path, "work-") as mine:
        assert not left.exists() and mine.is_dir()
        os.utime(mine / LOCK, (0, 0))
        with work_folder(tmp_path, "work-") as second:  # at work at the same time
            assert mine.is_dir() and second.is_dir()
    assert [path.name for path in tmp_path.iterdir()] == ["work-of_somebody_else"]


SCRIPT = """
from blender_tests.engine.capture.test_child_process import count
from karf_engine.capture.child_process import child_messages

print("run")
with child_messages("counting", count, 1) as messages:
    print(list(messages)[-1])
"""


def test_a_script_that_learns_is_not_run_again_in_the_child(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, str(script)], env=environment, capture_output=True, text=True, timeout=60)
    assert done.stdout.splitlines() == ["run", "('result', 'all told')"], done.stderr
