"""Child processes of another Python, each the leader of a process group: what they start ends with them. No bpy."""

import contextlib
import os
import signal
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any

from .. import engine_api

TERMINATE_SECONDS = 5.0
LEAKS = ("PYTHON", "LD_LIBRARY_PATH", "LD_PRELOAD", "DYLD_", "OCIO", "BLENDER_")
THREAD_VARIABLES = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
# Windows has no SIGKILL: there both steps end the process at once
KILL = getattr(signal, "SIGKILL", signal.SIGTERM)
NO_VARIABLES: Mapping[str, str] = {}
SIGNAL_NAMES = {each.value: each.name for each in signal.Signals}


def child_environment(variables: Mapping[str, str], threads: int = 0) -> dict[str, str]:
    """Return the environment without what would lead another Python to Blender's libraries; threads 0: as it is."""
    kept = {name: value for name, value in variables.items() if not name.startswith(LEAKS)}
    if threads:
        kept.update(dict.fromkeys(THREAD_VARIABLES, str(threads)))
    return kept


def engine_command(python: Path, verb: str, *arguments: Any) -> list[str]:
    """Return the command line for a Python that executes the engine."""
    # -B: no compiled files appear in the extension's folder, which updates replace
    return [str(python), "-I", "-B", "-u", "-X", "utf8", str(engine_api.ENGINE_FOLDER), verb, *map(str, arguments)]


def start(
    command: Sequence[str], threads: int = 0, variables: Mapping[str, str] = NO_VARIABLES, **options: Any
) -> subprocess.Popen:
    """Start a command in a new process group, without Blender's environment but with these variables.

    threads: of numerical libraries; 0: they choose. Raises OSError where it does not start.
    """
    if os.name == "nt":
        own_group = {"creationflags": subprocess.CREATE_NO_WINDOW | subprocess.CREATE_NEW_PROCESS_GROUP}
    else:
        own_group = {"start_new_session": True}
    return subprocess.Popen(
        command, env=child_environment(os.environ, threads) | dict(variables), **own_group, **options
    )


def send(process: subprocess.Popen, number: int) -> None:
    """Send a signal to a process and to all it has started; on Windows these are ended by any signal."""
    if os.name == "nt":
        with contextlib.suppress(OSError):  # a system may lack it
            tree = ["taskkill", "/F", "/T", "/PID", str(process.pid)]
            subprocess.run(tree, capture_output=True, creationflags=subprocess.CREATE_NO_WINDOW)
        with contextlib.suppress(OSError):  # it may be gone
            process.terminate()
    else:
        with contextlib.suppress(OSError):  # it may be gone
            os.killpg(process.pid, number)  # the child leads its own group


def end(process: subprocess.Popen) -> None:
    """End a process and all it has started now; waits for it a few seconds at most."""
    if process.poll() is None:
        for number in (signal.SIGTERM, KILL):
            send(process, number)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(TERMINATE_SECONDS)


def ending(process: subprocess.Popen) -> str:
    """Return how a process ended: the signal's name, or its exit code."""
    code = process.returncode or 0
    return SIGNAL_NAMES.get(-code) or f"exit code {code if -256 < code < 256 else hex(code)}"


class Inquiry:
    """A verb of the engine as a child process; raises OSError where it does not start."""

    def __init__(self, python: Path, verb: str, *arguments: Any, threads: int) -> None:
        # files take any amount of words; a pipe that nobody reads would hold the child up
        self._said, self._errors = tempfile.TemporaryFile(), tempfile.TemporaryFile()
        command = engine_command(python, verb, *arguments, *(("--threads", threads) if threads else ()))
        self.process = start(command, threads, stdin=subprocess.DEVNULL, stdout=self._said, stderr=self._errors)

    def lines(self) -> list[str]:
        """Return what it has said so far, whole lines only."""
        return [line for line in _read(self._said).splitlines(keepends=True) if line.endswith("\n")]

    def reason(self) -> str:
        """Return why it ended: the last line of its errors, else its exit code or signal."""
        return (_read(self._errors).strip().splitlines() or [ending(self.process)])[-1]

    def end(self) -> None:
        end(self.process)


def _read(stream: IO[bytes]) -> str:
    stream.seek(0)
    return stream.read().decode("utf-8", "replace")
