"""Run a function in a child process that can be killed, for libraries that cannot be interrupted or may abort.

Their temporary folders are removed with the process that made them, or by the next one if it was killed.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import ModuleType
from typing import Any

from filelock import Timeout

from ..errors import KarfError, error_from_code
from ..io.failures import translate_error
from ..io.locks import acquire

LOCK = ".karf-work"  # lock file of a work folder, released by the system when the process ends
YOUNG = 10.0  # seconds; the owner of a newer folder may not have locked it yet
Message = tuple[str, Any]
SILENCE: Message = ("", None)  # sent ten times a second between messages, so that the reader can check for cancellation


@contextmanager
def child_messages(name: str, work: Callable[[Callable[[str, Any], None], Any], Any], task: Any) -> Iterator[Iterator]:
    """Run `work(send, task)` in a new process and yield its messages (kind, value), the last one ("result", value).

    The child is killed at the end of the block, and ends if this process dies. `work` is a module-level function,
    `task` is picklable, and `name` is that of the library, for errors. Raises KarfError if the child fails or dies.
    """
    context = get_context("spawn")  # a fork would share torch's threads
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=_run, args=(sender, work, task), daemon=True)
    main = sys.modules["__main__"]
    sys.path.append(str(Path(__file__).parents[2]))  # the package may be outside the child's sys.path
    sys.modules["__main__"] = ModuleType("__main__")  # keeps the child from running the caller's script
    try:
        child.start()
    finally:
        sys.modules["__main__"] = main
        sys.path.pop()
    sender.close()  # so that the pipe closes with the child
    try:
        yield _messages(name, child, receiver)
    finally:
        child.kill()
        child.join()
        receiver.close()


def _run(pipe: Connection, work: Callable, task: Any) -> None:
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        pipe.send(("result", work(lambda kind, value=None: pipe.send((kind, value)), task)))
    except Exception as error:
        known = translate_error(error)
        content = (known.code, known.sentence, known.hint) if known else str(error) or type(error).__name__
        pipe.send(("failure" if known else "error", content))


def _end_with_parent() -> None:
    parent = parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)


def _messages(name: str, child: BaseProcess, pipe: Any) -> Iterator[Message]:
    while True:
        try:
            kind, value = pipe.recv() if pipe.poll(0.1) else SILENCE
        except EOFError:
            child.join()
            raise KarfError(
                f"{name} ended without a result (exit code {child.exitcode}).", "Use fewer or smaller photos."
            ) from None
        if kind == "failure":
            raise error_from_code(*value)
        if kind == "error":
            raise KarfError(f"{name} failed: {value}.", "Try other photos, or give a capture with poses.")
        yield kind, value
        if kind == "result":
            return


# --------------------------------------------------------------------------------------------------------- work folders
@contextmanager
def work_folder(parent: Path, prefix: str) -> Iterator[Path]:
    """Create a folder in `parent` whose name begins with `prefix`, and remove it at the end of the block."""
    _remove_leftovers(parent, prefix)
    folder = Path(tempfile.mkdtemp(prefix=prefix, dir=parent))
    try:
        lock = acquire(folder / LOCK)
        try:
            yield folder
        finally:
            lock.release()
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _remove_leftovers(parent: Path, prefix: str) -> None:
    """Remove the work folders of processes that have ended."""
    for folder in parent.iterdir():
        lock = folder / LOCK
        if not folder.name.startswith(prefix) or folder.is_symlink() or not lock.is_file():
            continue
        if time.time() - lock.stat().st_mtime < YOUNG:
            continue
        try:
            acquire(lock).release()
        except (Timeout, OSError):  # in use, or of another user
            continue
        shutil.rmtree(folder, ignore_errors=True)
