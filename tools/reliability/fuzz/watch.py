"""Read one file under watch: what must never happen is noted, whatever the reader does.

Limits: ten seconds, a gigabyte of memory above what is in use. Noted: an exception that is no KarfError, writing outside
the given folder, unpickling, starting a program, opening a connection.
"""

from __future__ import annotations

import os
import re
import resource
import signal
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from karf_engine.errors import KarfError

SECONDS = 10
BYTES = 1 << 30
LONGEST = 2000  # letters of a sentence
FORBIDDEN = (
    "pickle.find_class",
    "subprocess.Popen",
    "os.system",
    "os.exec",
    "os.posix_spawn",
    "os.fork",
    "socket.connect",
)
CHANGES = ("os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.link", "os.symlink", "os.truncate", "os.chmod")
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT


@dataclass(frozen=True)
class Outcome:
    """What a reader made of a file. finding: what must never happen, or None; refused: whether in a sentence."""

    refused: bool = False
    finding: str | None = None


class TooSlow(BaseException):
    """The time is over; not an Exception, so that no reader takes it for damage."""


_notes: list[str] | None = None  # of the running watch
_folder = ""
_hooked = False


def read_watched(read: Callable[[Path], object], path: Path, folder: Path) -> Outcome:
    """Read a file; the reader may write in the folder only."""
    with _watched(folder) as notes:
        outcome = _outcome(read, path)
    return Outcome(outcome.refused, notes[0]) if notes else outcome


def _outcome(read: Callable[[Path], object], path: Path) -> Outcome:
    try:
        read(path)
    except KarfError as error:
        return Outcome(True, _flaw(error))
    except TooSlow:
        return Outcome(finding=f"takes more than {SECONDS} s")
    except MemoryError as error:
        return Outcome(finding=f"takes more than 1 GB in {_place(error)}")
    except Exception as error:
        text = re.sub(r"\d+", "#", str(error))[:80]
        return Outcome(finding=f"{type(error).__name__} in {_place(error)}: {text}")
    return Outcome()


def _flaw(error: KarfError) -> str | None:
    """What is wrong with a refusal."""
    cause: BaseException | None = error.__cause__ or error.__context__
    while cause is not None:
        if isinstance(cause, MemoryError) or re.search(r"(?i)insufficient memory|bad_alloc|can't allocate", str(cause)):
            return f"takes more than 1 GB in {_place(cause)}"
        cause = cause.__cause__ or cause.__context__
    if error.exit_code == 70:
        return f"an internal error: {error.sentence[:80]}"
    return "a sentence without end" if len(error.sentence) > LONGEST else None


def _place(error: BaseException) -> str:
    """The innermost function of the engine."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "karf_engine" in frame.filename]
    return f"{Path(frames[-1].filename).name}: {frames[-1].name}" if frames else "?"


# ---------------------------------------------------------------------------------------------------------------- limits
@contextmanager
def _watched(folder: Path) -> Iterator[list[str]]:
    global _notes, _folder, _hooked
    if not _hooked:
        sys.addaudithook(_audit)
        _hooked = True
    _folder = os.path.realpath(folder)
    old_temporary, tempfile.tempdir = tempfile.tempdir, _folder
    old_handler = signal.signal(signal.SIGALRM, _too_slow)
    old_bytecode, sys.dont_write_bytecode = sys.dont_write_bytecode, True  # a late import is no writing of the reader's
    old_limit = resource.getrlimit(resource.RLIMIT_AS)
    notes: list[str] = []
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            resource.setrlimit(resource.RLIMIT_AS, (_in_use() + BYTES, old_limit[1]))
            signal.setitimer(signal.ITIMER_REAL, SECONDS)
            _notes = notes
            yield notes
    finally:
        _notes = None
        signal.setitimer(signal.ITIMER_REAL, 0)
        resource.setrlimit(resource.RLIMIT_AS, old_limit)
        signal.signal(signal.SIGALRM, old_handler)
        sys.dont_write_bytecode = old_bytecode
        tempfile.tempdir = old_temporary


def _in_use() -> int:
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()


def _too_slow(number: int, frame) -> None:
    raise TooSlow


def _audit(event: str, arguments: tuple) -> None:
    if _notes is None:
        return
    note = ""
    if event in FORBIDDEN:
        note = f"{event} {str(arguments)[:80]}"
    elif event in CHANGES or (event == "open" and isinstance(arguments[2], int) and arguments[2] & WRITING):
        targets = arguments[:2] if event in ("os.rename", "os.link", "os.symlink") else arguments[:1]
        note = next((f"writes outside: {event} {path}" for path in map(_outside, targets) if path), "")
    if note:
        _notes.append(note)
        raise PermissionError(note)  # so that it does not come to pass


def _outside(target) -> str:
    """The path, where it lies outside the watched folder; an open file has been judged when it was opened."""
    if not isinstance(target, str | bytes | os.PathLike):
        return ""
    path = os.path.realpath(os.fsdecode(target))
    allowed = path == _folder or path.startswith(_folder + os.sep) or path == os.devnull
    return "" if allowed else path
