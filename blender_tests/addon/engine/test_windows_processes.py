"""Child processes as they are started and ended on Windows, simulated: its Popen options and its taskkill."""

import os
import signal
from types import SimpleNamespace

import pytest

NO_WINDOW, NEW_GROUP = 0x08000000, 0x00000200  # as Windows has them


@pytest.fixture
def windows(addon, monkeypatch):
    """The module's system and subprocess as on Windows: the options of processes, and the commands that were run."""
    seen = SimpleNamespace(started=[], run=[])
    subprocess = SimpleNamespace(
        CREATE_NO_WINDOW=NO_WINDOW,
        CREATE_NEW_PROCESS_GROUP=NEW_GROUP,
        Popen=lambda command, **options: seen.started.append(options),
        run=lambda command, **options: seen.run.append((command, options["creationflags"])),
    )
    monkeypatch.setattr(addon.processes, "os", SimpleNamespace(name="nt", environ=dict(os.environ)))
    monkeypatch.setattr(addon.processes, "subprocess", subprocess)
    return seen


def test_a_child_opens_no_console_and_leads_a_group(addon, windows):
    addon.processes.start(["python"])
    (options,) = windows.started
    assert options["creationflags"] == NO_WINDOW | NEW_GROUP and "start_new_session" not in options


@pytest.mark.parametrize("missing", [None, "taskkill", "the process"])
def test_send_ends_the_process_tree_even_without_taskkill(addon, windows, monkeypatch, missing):
    def refuse(*_, **__):
        raise OSError(2, "missing")

    ended = []
    if missing == "taskkill":
        monkeypatch.setattr(addon.processes.subprocess, "run", refuse)
    terminate = refuse if missing == "the process" else lambda: ended.append(True)
    addon.processes.send(SimpleNamespace(pid=4711, terminate=terminate), signal.SIGTERM)
    assert windows.run == [(["taskkill", "/F", "/T", "/PID", "4711"], NO_WINDOW)] * (missing != "taskkill")
    assert ended == [True] * (missing != "the process")


@pytest.mark.parametrize(("code", "said"), [(3221225477, "0xc0000005"), (1, "exit code 1"), (-9, "SIGKILL")])
def test_exit_codes_of_crashes_are_hexadecimal(addon, code, said):
    assert said in addon.processes.ending(SimpleNamespace(returncode=code))
