"""Run engine commands in processes forked from one that has imported torch, which start fast and can be killed."""

from __future__ import annotations

import json
import multiprocessing
import os
import re
import signal
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection

from tools.dev import ONE_THREAD

TIMEOUT = 120.0
STAGES = ("geometry", "segmentation", "palette", "recoloring", "splats", "render", "match")
IMPORTED = [
    "__main__",
    "encodings.utf_8_sig",  # for a child that may not read Python's own files
    "torch._dynamo",  # what the first step of an optimizer imports
    "karf_engine.cli",
    *(f"karf_engine.commands.{stage}" for stage in STAGES),
]
SENTENCE = re.compile(r"^(?:(?:error|warning): |(?=cancelled; ))(.*)", re.MULTILINE)
FORKING = multiprocessing.get_context("forkserver") if os.name != "nt" else None


@dataclass(frozen=True)
class Run:
    """An ended command. code: exit code, minus the signal that killed it, or None for a hang."""

    code: int | None
    text: str
    killed: bool = False  # by us

    @property
    def sentence(self) -> str:
        """The last error or warning that it printed, or nothing."""
        found = SENTENCE.findall(self.text)
        return found[-1] if found else ""

    @property
    def flaw(self) -> str | None:
        """Return what no fault excuses, if any: a traceback, a crash, a hang, or a failure without a message."""
        if self.killed:
            return None
        if self.code is None:
            return f"hangs for more than {TIMEOUT:.0f} s"
        if self.code < 0:
            return f"crashes by {signal.Signals(-self.code).name}"
        if self.code == 70 or "Traceback" in self.text:
            return f"internal error: {self.sentence or self.text.strip().splitlines()[-1]}"
        return f"ends with {self.code} and no sentence" if self.code and not self.sentence else None


def prepare(patch) -> None:
    """Import the engine with one thread, as forks need, in the process that all others are forked from."""
    for name, value in ONE_THREAD.items():
        patch.setenv(name, value)
    FORKING.set_forkserver_preload(IMPORTED)


class Child:
    """An engine command running in its own process.

    before: called in that process before the command, to set a limit or a trap; it is pickled. Output comes through a
    pipe, out of reach of a limit of file sizes.
    """

    def __init__(self, arguments: Sequence[str], before: Callable[[], object] | None = None) -> None:
        self._printed = bytearray()
        self._killed = False
        self._out, end = FORKING.Pipe(duplex=False)
        self._process = FORKING.Process(target=_become, args=(arguments, end, before))
        self._process.start()
        end.close()
        os.set_blocking(self._out.fileno(), False)

    def stop(self, number: int = signal.SIGKILL) -> None:
        """Send a signal, unless the process has ended."""
        try:
            os.kill(self._process.pid, number)
        except ProcessLookupError:
            return
        self._killed = self._killed or number == signal.SIGKILL

    def wait(self) -> Run:
        """Wait for its end; kill it after TIMEOUT."""
        end = time.monotonic() + TIMEOUT
        while self._process.is_alive() and time.monotonic() < end:
            self._drain()
            self._process.join(0.005)
        hung = self._process.is_alive()
        if hung:
            self._process.kill()
            self._process.join()
        self._drain()
        self._out.close()
        code = None if hung else self._process.exitcode
        return Run(code, self._printed.decode(errors="replace"), self._killed and code == -signal.SIGKILL)

    def _drain(self) -> None:
        try:
            while part := os.read(self._out.fileno(), 65536):
                self._printed += part
        except BlockingIOError:
            pass


def run(arguments: Sequence[str], before: Callable[[], object] | None = None) -> Run:
    """Run one command to its end."""
    return Child(arguments, before).wait()


def run_all(commands: Sequence[Sequence[str]]) -> tuple[list[int | None], str]:
    """Run commands in turn in one process; returns their exit codes (None: never ended) and the output."""
    done = Child(["several", *map(json.dumps, commands)]).wait()
    codes = [int(code) for code in re.findall(r"^code (\d+)$", done.text, re.MULTILINE)]
    return codes + [None] * (len(commands) - len(codes)), done.text


def _run_one(arguments: Sequence[str]) -> int:
    from karf_engine.cli import main

    try:
        return main(list(arguments))
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else 1


def _become(arguments: Sequence[str], out: Connection, before: Callable[[], object] | None) -> None:
    """In the new process: run the command and end."""
    code = 99
    try:
        os.setsid()
        for number in (1, 2):
            os.dup2(out.fileno(), number)
        sys.stdout, sys.stderr = (open(number, "w", buffering=1, closefd=False) for number in (1, 2))
        if before is not None:
            before()
        if arguments[0] == "several":
            for command in arguments[1:]:
                print(f"code {_run_one(json.loads(command))}", flush=True)
            code = 0
        else:
            code = _run_one(arguments)
        sys.stdout.flush()
        sys.stderr.flush()
    except KeyboardInterrupt:  # it came before the command began
        code = 6
        os.write(2, b"cancelled; nothing was begun.\n")
    except BaseException as error:  # the engine let it through, which the tests must see in the output
        os.write(2, f"Traceback: {error!r}\n".encode())
    finally:
        os._exit(code)
