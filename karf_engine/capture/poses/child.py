"""Work in a child process that may be killed at any time: for libraries that cannot be interrupted, or that abort."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import ModuleType
from typing import Any

from ...errors import KarfError, error_from_code
from ...io.failures import known_failure

Message = tuple[str, Any]
SILENCE: Message = ("", None)  # ten times a second while the child says nothing, so that its reader can do other things


@contextmanager
def child_messages(name: str, work: Callable[[Callable[[str, Any], None], Any], Any], task: Any) -> Iterator[Iterator]:
    """Run `work(send, task)` in a new process; gives its messages (kind, value), the last one ("result", returned value).

    name: of the library at work, for errors. work: a function of a module. Raises KarfError where the child fails or
    dies. At the end of the block the child is killed; it ends by itself where this process is killed.
    """
    context = get_context("spawn")  # a fork would share torch's threads
    here, there = context.Pipe(duplex=False)
    child = context.Process(target=_run, args=(there, work, task), daemon=True)
    main = sys.modules["__main__"]
    sys.path.append(str(Path(__file__).parents[3]))  # the engine may run as a folder, off the path that the child gets
    sys.modules["__main__"] = ModuleType("__main__")  # else the child would run the caller's script again
    try:
        child.start()
    finally:
        sys.modules["__main__"] = main
        sys.path.pop()
    there.close()  # so that the pipe ends with the child
    try:
        yield _messages(name, child, here)
    finally:
        child.kill()
        child.join()
        here.close()


def _run(pipe: Connection, work: Callable, task: Any) -> None:
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        pipe.send(("result", work(lambda kind, value=None: pipe.send((kind, value)), task)))
    except Exception as error:
        known = known_failure(error)
        told = (known.code, known.sentence, known.hint) if known else str(error) or type(error).__name__
        pipe.send(("failure" if known else "error", told))


def _end_with_parent() -> None:
    """End this process when the one that began it has ended, however it did."""
    wait([parent_process().sentinel])
    os._exit(1)


def _messages(name: str, child: BaseProcess, pipe: Connection) -> Iterator[Message]:
    while True:
        kind, value = _received(name, child, pipe) if pipe.poll(0.1) else SILENCE
        if kind == "failure":
            raise error_from_code(*value)
        if kind == "error":
            raise KarfError(f"{name} failed: {value}.", "Try other photos, or give a capture with poses.")
        yield kind, value
        if kind == "result":
            return


def _received(name: str, child: BaseProcess, pipe: Connection) -> Message:
    try:
        return pipe.recv()
    except EOFError:
        child.join()
        raise KarfError(
            f"{name} ended without a result (exit code {child.exitcode}).", "Use fewer or smaller photos."
        ) from None
