"""Child processes as they are started and ended on Windows, simulated: its Popen options and its taskkill."""

import os
import signal
from types import SimpleNamespace

import pytest

CREATE_NO_WINDOW, CREATE_NEW_PROCESS_GROUP = 0x08000000, 0x00000200  # as Windows has them


@pytest.fixture
def windows(addon, monkeypatch):
    """The module's system and its subprocess as on Windows; gives what was called."""
    processes = addon.processes
    seen = SimpleNamespace(started=[], run=[])
    subprocess = SimpleNamespace(
        CREATE_NO_WINDOW=CREATE_NO_WINDOW,
        CREATE_NEW_PROCESS_GROUP=CREATE_NEW_PROCESS_GROUP,
        Popen=lambda command, **options: seen.started.append(options),
        run=lambda command, **options: seen.run.append((command, options)),
    )
    monkeypatch.setattr(processes, "os", SimpleNamespace(name="nt", environ=dict(os.environ)))
    monkeypatch.setattr(processes, "subprocess", subprocess)
    return SimpleNamespace(processes=processes, seen=seen, subprocess=subprocess)


class Child:
    """A process that is there, or has ended."""

    def __init__(self, is_gone=False):
        self.pid, self.is_gone, self.ended = 4711, is_gone, 0

    def terminate(self):
        if self.is_gone:
            raise PermissionError(13, "Access is denied")
        self.ended += 1


def test_a_child_opens_no_console_and_leads_a_group(windows):
    windows.processes.start(["python"])
    (options,) = windows.seen.started
    assert options["creationflags"] == CREATE_NO_WINDOW | CREATE_NEW_PROCESS_GROUP
    assert "start_new_session" not in options


def test_ending_a_child_ends_all_it_has_started_and_opens_no_console(windows):
    child = Child()
    windows.processes.send(child, signal.SIGTERM)
    ((command, options),) = windows.seen.run
    assert command == ["taskkill", "/F", "/T", "/PID", "4711"]
    assert options["creationflags"] == CREATE_NO_WINDOW
    assert child.ended == 1


def test_a_child_is_ended_where_the_system_has_no_taskkill(windows, monkeypatch):
    def missing(command, **options):
        raise FileNotFoundError(2, "The system cannot find the file specified")

    monkeypatch.setattr(windows.subprocess, "run", missing)
    child = Child()
    windows.processes.send(child, signal.SIGTERM)
    assert child.ended == 1


def test_one_that_is_gone_already_is_no_error(windows):
    windows.processes.send(Child(is_gone=True), signal.SIGTERM)


@pytest.mark.parametrize(("code", "said"), [(3221225477, "0xc0000005"), (1, "exit code 1"), (-9, "SIGKILL")])
def test_a_crash_is_told_by_the_number_that_windows_manuals_have(addon, code, said):
    assert said in addon.processes.ending(SimpleNamespace(returncode=code))
