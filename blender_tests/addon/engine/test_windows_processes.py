"""Child processes as they are started and ended on Windows, simulated: its Popen options and its taskkill."""

import os
import signal
from types import SimpleNamespace

import pytest

NO_WINDOW, NEW_GROUP = 0x08000000, 0x00000200  # as Windows has them


@pytest.fixture
def windows(addon, monkeypatch):
    """The module's system and its subprocess as on Windows: the options of processes, and the commands that were run."""
    seen = SimpleNamespace(started=[], run=[], has_taskkill=True)

    def run(command, **options):
        if not seen.has_taskkill:
            raise FileNotFoundError(2, "The system cannot find the file specified")
        seen.run.append((command, options["creationflags"]))

    subprocess = SimpleNamespace(
        CREATE_NO_WINDOW=NO_WINDOW,
        CREATE_NEW_PROCESS_GROUP=NEW_GROUP,
        Popen=lambda command, **options: seen.started.append(options),
        run=run,
    )
    monkeypatch.setattr(addon.processes, "os", SimpleNamespace(name="nt", environ=dict(os.environ)))
    monkeypatch.setattr(addon.processes, "subprocess", subprocess)
    return seen


def test_a_child_opens_no_console_and_leads_a_group(addon, windows):
    addon.processes.start(["python"])
    (options,) = windows.started
    assert options["creationflags"] == NO_WINDOW | NEW_GROUP and "start_new_session" not in options


@pytest.mark.parametrize("has_taskkill", [True, False])
@pytest.mark.parametrize("is_gone", [True, False])
def test_send_ends_the_process_tree_even_without_taskkill(addon, windows, has_taskkill, is_gone):
    ended = []

    def terminate():
        if is_gone:
            raise PermissionError(13, "Access is denied")
        ended.append(True)

    windows.has_taskkill = has_taskkill
    addon.processes.send(SimpleNamespace(pid=4711, terminate=terminate), signal.SIGTERM)
    assert windows.run == [(["taskkill", "/F", "/T", "/PID", "4711"], NO_WINDOW)] * has_taskkill
    assert ended == [True] * (not is_gone)


@pytest.mark.parametrize(("code", "said"), [(3221225477, "0xc0000005"), (1, "exit code 1"), (-9, "SIGKILL")])
def test_exit_codes_of_crashes_are_hexadecimal(addon, code, said):
    assert said in addon.processes.ending(SimpleNamespace(returncode=code))
