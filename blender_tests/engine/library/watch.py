"""Call one function under watch: how it ended, whether it took too long, and whether a file has changed."""

from __future__ import annotations

import faulthandler
import os
import signal
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from karf_engine.errors import KarfError

SECONDS = 10
PATIENCE = 3 * SECONDS  # after which the process ends: it hangs in what no signal reaches


class TooSlow(BaseException):
    """The time is over; not an Exception, so that nobody takes it for damage."""


def outcome(call: Callable[[], Any], names: tuple[str, ...], folder: Path) -> str:
    """How a call ends: `answered`, `refused`, or the flaw in a word and its details.

    Args:
        call: The call.
        names: Of the arguments that are wrong: a TypeError must name one of them.
        folder: Where no file may come, go or change.
    """
    before = _files(folder)
    ended = _ended(call, names)
    changed = sorted(str(path.relative_to(folder)) for path in dict(before ^ _files(folder)))
    return f"write: {', '.join(changed)}" if changed else ended


def _ended(call: Callable[[], Any], names: tuple[str, ...]) -> str:
    try:
        with _alarm():
            call()
    except KarfError as error:
        return "refused" if error.sentence and error.code != "internal" else f"traceback: {error!r}"
    except TypeError as error:
        is_named = any(name in str(error) for name in names)
        return "refused" if is_named else f"traceback: {error!r:.300} does not name {' or '.join(names)}"
    except TooSlow:
        return "hang"
    except Exception as error:
        return f"traceback: {error!r:.300}"
    return "answered"


def _files(folder: Path) -> set[tuple[Path, tuple[int, int]]]:
    facts = ((path, path.stat()) for path in folder.rglob("*"))
    return {(path, (stat.st_mtime_ns, 0 if path.is_dir() else stat.st_size)) for path, stat in facts}


@contextmanager
def _alarm():
    def ring(*_):
        raise TooSlow

    if os.name == "nt":  # it has no such timer
        yield
        return
    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(SECONDS)
    faulthandler.dump_traceback_later(PATIENCE, exit=True)
    try:
        yield
    finally:
        signal.alarm(0)
        faulthandler.cancel_dump_traceback_later()
        signal.signal(signal.SIGALRM, before)
