"""Read one file under watch: a forbidden action raises a Flaw even where the reader hides it.

Limits: ten seconds, and a gigabyte of memory above what is in use. Forbidden: an exception other than a KarfError,
writing outside the given folder, unpickling, starting a program, and opening a connection. The one program that may be
started is the engine's own limited Python (`karf_engine.io.limited`), whose memory is not watched here.
"""

import faulthandler
import os
import re
import resource
import signal
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from karf_engine.errors import KarfError

SECONDS = 10
PATIENCE = 2 * SECONDS  # then the process is ended, as it hangs where no signal reaches it
BYTES = 1 << 30
LONGEST = 2000  # characters of a message
INTERNAL = 70  # exit code
OUT_OF_MEMORY = r"(?i)insufficient memory|bad_alloc|can't allocate"
FORBIDDEN = (
    *("pickle.find_class", "subprocess.Popen", "socket.connect"),
    *("os.system", "os.exec", "os.posix_spawn", "os.fork"),
)
CHANGES = ("os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.link", "os.symlink", "os.truncate", "os.chmod")
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT


class Flaw(AssertionError):
    """Something that must never happen."""


class TooSlow(BaseException):
    """Time is up; not an Exception, so that no reader takes it for damage."""


_notes: list[str] | None = None  # of the running watch
_folder = ""
_hooked = False


def read_watched(read: Callable[[Path], object], path: Path, folder: Path) -> bool:
    """Test whether a file is read, not rejected with a message; the reader may write in the folder only.

    Raises a Flaw for forbidden actions, and any other error of the reader.
    """
    rejection = None
    with _watched(folder) as notes:
        try:
            read(path)
        except KarfError as error:
            rejection = error
        except TooSlow as error:
            raise Flaw(f"takes more than {SECONDS} s") from error
    if notes:
        raise Flaw(notes[0])
    if rejection is not None:
        _check(rejection)
    return rejection is None


def _check(rejection: KarfError) -> None:
    """Raise a Flaw where a rejection hides a lack of memory, or its message is not for a user."""
    cause: BaseException | None = rejection.__cause__ or rejection.__context__
    while cause is not None:
        if isinstance(cause, MemoryError) or re.search(OUT_OF_MEMORY, str(cause)):
            raise Flaw("takes more than 1 GB") from cause
        cause = cause.__cause__ or cause.__context__
    if rejection.exit_code == INTERNAL or len(rejection.sentence) > LONGEST:
        raise Flaw(f"not a message for a user: {rejection.sentence[:80]}") from rejection


@contextmanager
def _watched(folder: Path) -> Iterator[list[str]]:
    global _notes, _folder, _hooked
    if not _hooked:
        sys.addaudithook(_audit)
        _hooked = True
    _folder = os.path.realpath(folder)
    old_temporary, tempfile.tempdir = tempfile.tempdir, _folder
    old_handler = signal.signal(signal.SIGALRM, _too_slow)
    old_bytecode, sys.dont_write_bytecode = sys.dont_write_bytecode, True  # late imports must not count as writing
    old_limit = resource.getrlimit(resource.RLIMIT_AS)
    in_use = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    notes: list[str] = []
    faulthandler.dump_traceback_later(PATIENCE, exit=True, file=sys.__stderr__)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            resource.setrlimit(resource.RLIMIT_AS, (in_use + BYTES, old_limit[1]))
            signal.setitimer(signal.ITIMER_REAL, SECONDS)
            _notes = notes
            yield notes
    finally:
        _notes = None
        signal.setitimer(signal.ITIMER_REAL, 0)
        faulthandler.cancel_dump_traceback_later()
        resource.setrlimit(resource.RLIMIT_AS, old_limit)
        signal.signal(signal.SIGALRM, old_handler)
        sys.dont_write_bytecode = old_bytecode
        tempfile.tempdir = old_temporary


def _too_slow(number: int, frame) -> None:
    raise TooSlow


def _audit(event: str, arguments: tuple) -> None:
    if _notes is None:
        return
    note = ""
    if event in FORBIDDEN and not (event == "subprocess.Popen" and "karf_engine.io.limited" in str(arguments[1])):
        note = f"{event} {str(arguments)[:80]}"
    elif event in CHANGES or (event == "open" and isinstance(arguments[2], int) and arguments[2] & WRITING):
        targets = arguments[:2] if event in ("os.rename", "os.link", "os.symlink") else arguments[:1]
        if event in ("os.remove", "os.rmdir") and arguments[1] >= 0:  # relative to an open folder
            targets = (Path(f"/proc/self/fd/{arguments[1]}").readlink() / os.fsdecode(arguments[0]),)
        note = next((f"writes outside: {event} {path}" for path in map(_outside, targets) if path), "")
    if note:
        _notes.append(note)
        raise PermissionError(note)  # prevents it


def _outside(target) -> str:
    """The path if it lies outside the watched folder; an open file was checked when it was opened."""
    if not isinstance(target, str | bytes | os.PathLike):
        return ""
    path = os.path.realpath(os.fsdecode(target))
    return "" if path in (_folder, os.devnull) or path.startswith(_folder + os.sep) else path
