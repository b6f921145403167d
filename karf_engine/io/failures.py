"""Translate system errors (full disk, missing permission, out of memory) of any library into KarfErrors, and print them."""

from __future__ import annotations

import errno
import os
import re
import shutil
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import DataError, KarfError, OutOfMemory, is_out_of_memory

DISK_FULL_MESSAGES = ("disk is full", "requested and")  # SQLite; numpy
# safetensors (the second form before 0.5) and shutil give the errno only in the message
NUMBER_IN_TEXT = re.compile(r"\(os error (\d+)\)|Os \{ code: (\d+)|\[Errno (\d+)\]")
WINDOWS_ERRORS = {  # Win32 error codes, which libraries outside Python report
    2: errno.ENOENT, 3: errno.ENOENT, 5: errno.EACCES, 8: errno.ENOMEM, 14: errno.ENOMEM, 19: errno.EROFS,
    32: errno.EACCES, 33: errno.EACCES, 39: errno.ENOSPC, 112: errno.ENOSPC, 206: errno.ENAMETOOLONG,
}  # fmt: skip
WINDOWS_LONGEST_PATH = 259  # characters, unless long paths are enabled
FREE_SPACE = "Free some space, or choose a folder on another disk; what was finished is kept."
OTHER_FOLDER = "Choose a folder of your own, or change its rights; on Windows another program may hold the file open."
SYSTEM_ERRORS = {  # errno: (sentence, hint)
    errno.ENOSPC: ("The disk is full: {file} cannot be written.", FREE_SPACE),
    errno.EDQUOT: ("Your share of the disk is used up: {file} cannot be written.", FREE_SPACE),
    errno.EFBIG: ("{file} is larger than this disk's file system allows.", FREE_SPACE),
    errno.EACCES: ("{file} may not be read or written here.", OTHER_FOLDER),
    errno.EPERM: ("{file} may not be read or written here.", OTHER_FOLDER),
    errno.EROFS: ("{file} lies on a disk that can only be read.", "Choose a folder on another disk."),
    errno.ENOENT: ("{file} is not there, or no longer.", "Put it back, or check the path; then start again."),
    errno.ENOTDIR: ("{file} lies in a file instead of a folder.", "Check the path."),
    errno.EISDIR: ("{file} is a folder where a file is wanted.", "Check the path."),
    errno.EEXIST: ("{file} is a file where a folder is wanted.", "Choose another folder."),
    errno.ENAMETOOLONG: ("{file} is a name too long for this disk.", "Use shorter names of files and folders."),
    errno.EMFILE: ("Too many files are open at once.", "Close other programs, or raise the limit (ulimit -n)."),
    errno.ENFILE: ("Too many files are open at once.", "Close other programs, or restart the computer."),
}


def first_line(error: BaseException) -> str:
    """Return the first line of an error's message, without its final period."""
    return str(error).strip().split("\n")[0].rstrip(".:") or type(error).__name__


def translate_error(error: BaseException) -> KarfError | None:
    """Translate an error into one that a user can act on; None for a bug."""
    if isinstance(error, KarfError):
        return error
    if is_out_of_memory(error):
        return OutOfMemory("The computer ran out of memory.", "Lower geometry.long_side, or close other programs.")
    if isinstance(error, UnicodeEncodeError):  # only file names can hold characters that cannot be encoded
        return DataError(f"{error.object!r:.400} holds bytes that are not UTF-8.", "Rename that file or folder.")
    number = errno_of(error)
    if number is None:
        return None
    file = getattr(error, "filename", None) or "a file"
    if isinstance(error, shutil.Error):  # a list of (source, target, reason)
        file = error.args[0][0][1]
    reason = getattr(error, "strerror", None) or str(error)
    sentence, hint = SYSTEM_ERRORS.get(
        number, (f"{{file}} cannot be read or written: {reason}.", "Check the disk or the network drive.")
    )
    sentence = sentence.replace("{file}", str(file))
    return DataError(sentence[:1].upper() + sentence[1:], hint)


@contextmanager
def translate_errors() -> Iterator[None]:
    """Translate errors of the block by `translate_error`; bugs pass unchanged."""
    try:
        yield
    except Exception as error:
        known = translate_error(error)
        if known is None or known is error:
            raise
        raise known from error


def errno_of(error: BaseException) -> int | None:
    """Return the errno of a failed system call, from the message if the error has no other; None if there is none."""
    is_windows = os.name == "nt"
    if isinstance(error, OSError) and error.errno:
        is_long = len(str(error.filename or "")) > WINDOWS_LONGEST_PATH  # Windows reports these as missing
        return errno.ENAMETOOLONG if is_windows and is_long and error.errno == errno.ENOENT else error.errno
    if any(word in str(error) for word in DISK_FULL_MESSAGES):
        return errno.ENOSPC
    match = NUMBER_IN_TEXT.search(str(error))
    if match is None:
        return None
    number = int(match[match.lastindex or 0])
    return WINDOWS_ERRORS.get(number, number) if is_windows else number


def as_karf_error(error: Exception) -> KarfError:
    """Convert an exception for the user; print the traceback of an internal error."""
    if (known := translate_error(error)) is not None:
        return known
    log("".join(traceback.format_exception(error)).rstrip())
    return KarfError("Internal error: {error!r}.", "Report it with its trace (of a job: in engine.log).", error=error)


def print_error(error: KarfError) -> None:
    """Print an error's sentence and hint to standard error."""
    log(f"error: {error.sentence}\n       {error.hint}".rstrip())


def log(text: str) -> None:
    """Print to standard error, or nowhere if that is a log on a full disk."""
    try:
        print(text, file=sys.stderr, flush=True)
    except OSError:
        # else the interpreter would try again at exit, and change the exit code
        sys.stderr = Path(os.devnull).open("w", encoding="utf-8")
