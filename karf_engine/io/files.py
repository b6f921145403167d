"""Atomic writes, JSON files and checksums.

A file is written in a temporary folder beside it, flushed to disk and renamed, so that a killed process leaves the last
good state. The folder's name holds host and process id, so that leftovers of dead processes can be removed.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import shutil
import stat
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ..errors import DataError, KarfError
from .failures import errno_of
from .inputs import MAX_JSON_BYTES, check_file
from .processes import host_name, is_running

HOST = hashlib.sha256(host_name().encode()).hexdigest()[:8]
TEMPORARY = re.compile(r"\.karf-([0-9a-f]{8})-(\d{1,10})-[a-z0-9_]{8}")  # host, process id, random
HELD = (5, 32, 33, 1224)  # Windows errors: access denied, sharing violation, lock violation, mapped by a process
HELD_SECONDS = 3.0  # how long virus scanners and indexers may keep a new file open on Windows
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS)  # can only come from writing
PROBE_BYTES = 1 << 20  # more than a file system preallocates for an open file


def atomic_write(path: Path, write: Callable[[Path], object]) -> None:
    """Write a file whole or not at all; on any failure `path` stays unchanged.

    Writes through a symbolic link to its target, and keeps the mode of an existing file.

    Args:
        path: The file; its folder is created.
        write: Called with the path of a temporary file of the same suffix; the result is ignored.

    Raises:
        OSError: The disk is full, the folder cannot be written, or the file is read-only; names `path`.

    Examples:
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     atomic_write(Path(folder) / "note.txt", lambda temporary: temporary.write_text("done"))
        ...     (Path(folder) / "note.txt").read_text()
        'done'
    """
    target = Path(os.path.realpath(path)) if path.is_symlink() else path
    mode = _mode_of(target)
    folder = None
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        # a separate folder, because libraries create temporary files beside their output
        folder = temporary_folder(target.parent)
        temporary = folder / f"new{path.suffix}"  # image and npz writers derive the format from the suffix
        write(temporary)
        with temporary.open("rb+") as stream:
            os.fsync(stream.fileno())
        temporary.chmod(mode)
        replace(temporary, target)
    except KarfError:
        raise
    except Exception as error:
        number = _write_failure(error, target.parent, folder)
        if number is None:
            raise
        raise OSError(number, getattr(error, "strerror", None) or os.strerror(number), str(path)) from error
    finally:
        if folder:
            shutil.rmtree(folder, ignore_errors=True)


def temporary_folder(parent: Path) -> Path:
    """Create a folder that `remove_temporaries` removes once this process has ended."""
    return Path(tempfile.mkdtemp(prefix=f".karf-{HOST}-{os.getpid()}-", dir=parent))


def copy_file(source: Path, target: Path) -> None:
    """Copy a file atomically. Raises OSError, which names the source or the target."""
    atomic_write(target, lambda temporary: shutil.copyfile(source, temporary))


@contextmanager
def errors_naming_path(path: Path) -> Iterator[None]:
    """Raise failed writes of the block as OSError that names this file or folder, unless the error names a file itself."""
    try:
        yield
    except Exception as error:
        if isinstance(error, KarfError) and error.code != KarfError.code:
            raise
        number = errno_of(error) or _probe(path if path.is_dir() else path.parent)
        if number is None or getattr(error, "filename", None):
            raise
        raise OSError(number, getattr(error, "strerror", None) or os.strerror(number), str(path)) from error


def replace(source: Path, target: Path) -> None:
    """Rename a file or folder over the target and flush; on Windows, retry while another program has either open.

    Raises:
        OSError: The rename failed, or either was open for more than `HELD_SECONDS`.
    """
    deadline = time.monotonic() + HELD_SECONDS
    while True:
        try:
            source.replace(target)
            break
        except OSError as error:
            if getattr(error, "winerror", None) not in HELD or time.monotonic() > deadline:
                raise
        time.sleep(0.05)
    _flush_folder(target.parent)


def _flush_folder(folder: Path) -> None:
    if os.name == "nt":
        return
    with suppress(OSError):  # some network drives refuse
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _mode_of(target: Path) -> int:
    """Return the mode for a new version of a file. Raises PermissionError if the file is read-only."""
    try:
        mode = target.stat().st_mode
    except FileNotFoundError:
        return 0o666 & ~_umask()
    if not mode & 0o222 or not os.access(target, os.W_OK):  # root could write it all the same
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(target))
    return stat.S_IMODE(mode)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _write_failure(error: Exception, parent: Path, folder: Path | None) -> int | None:
    """Return the errno of a failed write; None if something else failed, such as reading a source."""
    number = errno_of(error)
    if number is None:
        return _probe(folder) if folder else None
    if number in NO_ROOM or not isinstance(error, OSError) or error.filename is None:
        return number
    return number if str(error.filename).startswith(str(parent / ".karf-")) else None


def _probe(folder: Path) -> int | None:
    """Return the errno of writing to a folder; None if it succeeds. C++ libraries do not report why a write failed."""
    try:
        with (folder / "probe").open("wb") as stream:
            stream.write(bytes(PROBE_BYTES))
            stream.flush()
            os.fsync(stream.fileno())
    except OSError as error:
        return error.errno
    return None


def write_json(path: Path, content: Any) -> None:
    """Write indented JSON atomically, the same bytes on every system. Raises ValueError for numbers that are not finite."""
    text = json.dumps(content, indent=1, allow_nan=False)
    atomic_write(path, lambda temporary: temporary.write_text(text + "\n", encoding="utf-8", newline="\n"))


def read_json(path: Path, what: str) -> Any:
    """Read a JSON file, called `what` in messages. Raises DataError if it is missing, too large or not JSON."""
    check_file(path, MAX_JSON_BYTES, f"{path} ({what})")
    try:
        return json.loads(path.read_text(encoding="utf-8-sig"))
    except json.JSONDecodeError as error:
        raise DataError(
            "{path} ({what}) is broken JSON at line {line}: {reason}.",
            "Export or write the file again.",
            path=path,
            what=what,
            line=error.lineno,
            reason=error.msg,
        ) from error
    except (OSError, ValueError, RecursionError) as error:  # not UTF-8, too many digits, too deeply nested
        raise DataError(f"{path} ({what}) cannot be read: {error}.", "Check the file.") from error


def checksum(path: Path) -> str:
    """Return the SHA-256 of a file as hexadecimal text. Raises DataError if it is not a regular file."""
    check_file(path)
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def remove_temporaries(folder: Path) -> None:
    """Remove the temporary folders that dead processes of this host left in a folder."""
    with suppress(OSError):  # the folder is missing
        for path in folder.iterdir():
            match = TEMPORARY.fullmatch(path.name)
            if match and match[1] == HOST and not is_running(int(match[2])):
                shutil.rmtree(path, ignore_errors=True)  # follows no links
