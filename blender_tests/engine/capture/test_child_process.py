"""Work in a child process: messages, failures, and cleaning up after killed processes."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from blender_tests.engine.conftest import ROOT
from karf_engine.capture.child_process import LOCK, child_messages, work_folder
from karf_engine.errors import KarfError


def count(send, task):
    for number in range(task):
        send("number", number)
    return "finished"


def fail(send, task):
    raise ValueError(task)


def die(send, task):
    os._exit(task)


def write_pid_and_sleep(send, task):
    Path(task).write_text(str(os.getpid()))
    time.sleep(600)


def test_messages_arrive_in_order_and_the_result_last():
    with child_messages("counting", count, 3) as messages:
        received = [message for message in messages if message[0]]
    assert received == [("number", 0), ("number", 1), ("number", 2), ("result", "finished")]


@pytest.mark.parametrize(("work", "task", "words"), [(fail, "no film", "no film"), (die, 7, "exit code 7")])
def test_failing_or_dying_child_raises_an_error(work, task, words):
    with pytest.raises(KarfError, match=words), child_messages("the camera", work, task) as messages:
        list(messages)


def test_leaving_early_ends_the_child(tmp_path):
    start = time.monotonic()
    with child_messages("sleeping", write_pid_and_sleep, str(tmp_path / "pid")) as messages:
        assert next(messages)[0] == ""
    assert time.monotonic() - start < 60


HEAD = """
import os, sys
from pathlib import Path
from blender_tests.engine.capture.test_child_process import count, write_pid_and_sleep
from karf_engine.capture.child_process import child_messages, work_folder
"""
SLEEPING = """
if __name__ == "__main__":
    with child_messages("sleeping", write_pid_and_sleep, sys.argv[1]) as messages:
        list(messages)
"""
LEAVING = """
with work_folder(Path(sys.argv[1]), "work-") as folder:
    (folder / "large.db").write_text("x")
    os.kill(os.getpid(), 9)
"""
LEARNING = """
print("run")
with child_messages("counting", count, 1) as messages:
    print(list(messages)[-1])
"""


def start(folder, script, *arguments):
    (folder / "script.py").write_text(HEAD + script)
    command = [sys.executable, folder / "script.py", *arguments]
    return subprocess.Popen(command, env=os.environ | {"PYTHONPATH": str(ROOT)}, stdout=subprocess.PIPE, text=True)


def test_child_ends_when_its_parent_is_killed(tmp_path):
    pid = tmp_path / "pid"
    parent = start(tmp_path, SLEEPING, pid)
    wait_for(lambda: pid.exists() and pid.read_text())
    child = int(pid.read_text())
    assert is_alive(child)
    parent.kill()
    parent.wait()
    wait_for(lambda: not is_alive(child))


def is_alive(pid):
    """Test whether the process runs; a zombie does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait_for(condition):
    end = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_next_process_removes_the_work_folder_of_a_killed_one(tmp_path):
    folder = tmp_path / "work"
    folder.mkdir()
    start(tmp_path, LEAVING, folder).wait(60)
    (left,) = folder.glob("work-*")
    (folder / "work-of_another_program").mkdir()
    os.utime(left / LOCK, (0, 0))
    with work_folder(folder, "work-") as mine:
        assert not left.exists() and mine.is_dir()
        os.utime(mine / LOCK, (0, 0))
        with work_folder(folder, "work-") as second:  # both work at the same time
            assert mine.is_dir() and second.is_dir()
    assert [path.name for path in folder.iterdir()] == ["work-of_another_program"]


def test_script_is_not_run_again_in_the_child(tmp_path):
    printed, _ = start(tmp_path, LEARNING).communicate(timeout=60)
    assert printed.splitlines() == ["run", "('result', 'finished')"]
