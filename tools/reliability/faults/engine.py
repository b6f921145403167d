"""Commands of the engine in processes that are forked once torch is imported: real ones, really killed, soon started."""

from __future__ import annotations

import os
import re
import signal
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module

TIMEOUT = 120.0
MODULES = ("geometry", "segmentation", "palette", "recoloring", "render", "match")
SENTENCE = re.compile(r"^(?:(?:error|warning): |(?=cancelled; ))(.*)", re.MULTILINE)


@dataclass(frozen=True)
class Run:
    """One command that has ended. code: exit code, minus the signal that killed it, or None where it hung."""

    code: int | None
    text: str
    killed: bool = False  # by us

    @property
    def sentence(self) -> str:
        """What it told the user last: an error, a warning, or nothing."""
        found = SENTENCE.findall(self.text)
        return found[-1] if found else ""

    @property
    def flaw(self) -> str | None:
        """What no fault excuses: a trace, a crash, a hang, or a failure without a sentence."""
        if self.killed:
            return None
        if self.code is None:
            return f"hangs for more than {TIMEOUT:.0f} s"
        if self.code < 0:
            return f"crashes by {signal.Signals(-self.code).name}"
        if self.code == 70 or "Traceback" in self.text:
            return f"internal error: {self.sentence or self.text.strip().splitlines()[-1]}"
        return f"ends with {self.code} and no sentence" if self.code and not self.sentence else None


def prepare() -> None:
    """Import once what every command needs, with one thread: a process that is forked later must find no others."""
    import torch
    import torch._dynamo  # what the first step of an optimizer imports

    for name in ("cli", *(f"commands.{stage}" for stage in MODULES)):
        import_module(f"karf_engine.{name}")
    torch.set_num_threads(1)


class Child:
    """One command of the engine that is running in a process of its own.

    before: called in that process before the command, to set a limit or a trap. What the command prints comes through a
    pipe: a limit of file sizes does not reach it.
    """

    def __init__(self, arguments: Sequence[str], before: Callable[[], None] | None = None) -> None:
        self._printed = bytearray()
        self._killed = False
        self._pipe, end = os.pipe()
        self.process = os.fork()
        if not self.process:
            _become(arguments, end, before)
        os.close(end)
        os.set_blocking(self._pipe, False)

    def stop(self, number: int = signal.SIGKILL) -> None:
        """Send a signal; a process that has ended already gets none."""
        try:
            os.kill(self.process, number)
        except ProcessLookupError:
            return
        self._killed = self._killed or number == signal.SIGKILL

    def wait(self, seconds: float = TIMEOUT) -> Run:
        """Wait for its end; what lasts longer is ended."""
        end = time.monotonic() + seconds
        while True:
            process, status = os.waitpid(self.process, os.WNOHANG)
            self._drain()
            if process:
                return self._run(os.waitstatus_to_exitcode(status))
            if time.monotonic() > end:
                os.kill(self.process, signal.SIGKILL)
                os.waitpid(self.process, 0)
                return self._run(None)
            time.sleep(0.002)

    def _drain(self) -> None:
        try:
            while part := os.read(self._pipe, 65536):
                self._printed += part
        except BlockingIOError:
            pass

    def _run(self, code: int | None) -> Run:
        os.close(self._pipe)
        killed = self._killed and code == -signal.SIGKILL
        return Run(code, self._printed.decode(errors="replace"), killed)


def run(arguments: Sequence[str], before: Callable[[], None] | None = None) -> Run:
    """Run one command to its end."""
    return Child(arguments, before).wait()


def _become(arguments: Sequence[str], out: int, before: Callable[[], None] | None) -> None:
    """In the new process: run the command and end."""
    code = 99
    try:
        os.setsid()
        for number in (1, 2):
            os.dup2(out, number)
        if before is not None:
            before()
        from karf_engine.cli import main

        code = main(list(arguments))
        sys.stdout.flush()
        sys.stderr.flush()
    except KeyboardInterrupt:  # it came before the command began
        code = 6
        os.write(2, b"cancelled; nothing was begun.\n")
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else 1
    except BaseException as error:  # what the engine let through is a finding, told in what is printed
        os.write(2, f"Traceback: {error!r}\n".encode())
    finally:
        os._exit(code)
