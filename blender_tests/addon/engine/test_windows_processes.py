"""Starting and ending child processes on a simulated Windows."""

import os
import signal
from types import SimpleNamespace

import pytest

NO_WINDOW, NEW_GROUP = 0x08000000, 0x00000200  # as Windows has them


@pytest.fixture
def windows(addon, monkeypatch):
    """Windows as the module sees it; records the options of started processes and the commands run."""
    calls = SimpleNamespace(started=[], run=[])
    subprocess = SimpleNamespace(
        CREATE_NO_WINDOW=NO_WINDOW,
        CREATE_NEW_PROCESS_GROUP=NEW_GROUP,
        Popen=lambda command, **options: calls.started.append(options),
        run=lambda command, **options: calls.run.append((command, options["creationflags"])),
    )
    monkeypatch.setattr(addon.processes, "os", SimpleNamespace(name="nt", environ=dict(os.environ)))
    monkeypatch.setattr(addon.processes, "subprocess", subprocess)
    return calls


def test_child_opens_no_console_and_leads_a_group(addon, windows):
    addon.processes.start(["python"])
    (options,) = windows.started
    assert options["creationflags"] == NO_WINDOW | NEW_GROUP and "start_new_session" not in options


@pytest.mark.parametrize("missing", [None, "taskkill", "the process"])
def test_process_tree_ends_even_without_taskkill(addon, windows, monkeypatch, missing):
    def fail(*_, **__):
        raise OSError(2, "missing")

    ended = []
    if missing == "taskkill":
        monkeypatch.setattr(addon.processes.subprocess, "run", fail)
    terminate = fail if missing == "the process" else lambda: ended.append(True)
    addon.processes.send(SimpleNamespace(pid=4711, terminate=terminate), signal.SIGTERM)
    assert windows.run == [(["taskkill", "/F", "/T", "/PID", "4711"], NO_WINDOW)] * (missing != "taskkill")
    assert ended == [True] * (missing != "the process")


@pytest.mark.parametrize(("code", "text"), [(3221225477, "0xc0000005"), (1, "exit code 1"), (-9, "SIGKILL")])
def test_crash_exit_codes_are_hexadecimal(addon, code, text):
    assert text in addon.processes.ending(SimpleNamespace(returncode=code))
