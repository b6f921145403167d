"""Files: checks before opening, atomic writes, JSON, checksums, fingerprints, and paths for C libraries.

Opening a pipe blocks and reading a device never ends, so files from outside are checked first. A file is written in a temporary folder beside it, flushed to disk and renamed, so that a killed process leaves the last
good state. The folder's name holds host and process id, so that leftovers of dead processes can be removed.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import platform
import re
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ..errors import BadRequest, DataError, KarfError
from .failures import errno_of

MAX_JSON_BYTES = 32 << 20  # bytes; parsed objects take up to thirty times as much
MOST_BYTES = 8 << 30  # bytes of a file that is read whole
WHOLE_BYTES, END_BYTES = 2**20, 2**18  # larger files are fingerprinted at both ends only
TEMPORARY = re.compile(r"\.karf-([0-9a-f]{8})-(\d{1,10})-[a-z0-9_]{8}")  # host, process id, random
HELD = (5, 32, 33, 1224)  # Windows errors: access denied, sharing violation, lock violation, mapped by a process
HELD_SECONDS = 3.0  # how long virus scanners and indexers may keep a new file open on Windows
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS)  # can only come from writing
PROBE_BYTES = 1 << 20  # more than a file system preallocates for an open file
SYNCHRONIZE, NO_SUCH_PROCESS, STILL_RUNS = 0x100000, 87, 0x102  # Windows: access right, error, wait result


def host_name() -> str:
    """Return the name of this computer, on Linux with its process namespace (containers number processes anew)."""
    with suppress(OSError):
        return f"{platform.node()} {Path('/proc/self/ns/pid').readlink()}"
    return platform.node()


HOST = hashlib.sha256(host_name().encode()).hexdigest()[:8]


def check_file(path: Path, most: int = MOST_BYTES, label: str = "") -> int:
    """Return the size in bytes of a regular file, called `label` in messages; links are followed.

    Raises DataError if it is missing, not a regular file, or larger than `most`.
    """
    label = label or str(path)
    try:
        status = path.stat()
    except FileNotFoundError as error:
        raise DataError("{path} does not exist.", "Check the path.", path=label) from error
    except (OSError, ValueError) as error:  # circular links, invalid names
        raise DataError(
            "{path} cannot be read: {reason}.", "Check the path.", path=label, reason=getattr(error, "strerror", error)
        ) from error
    if stat.S_ISDIR(status.st_mode):
        raise DataError(f"{label} is a folder, not a file.", "Check the path.")
    if not stat.S_ISREG(status.st_mode):
        raise DataError(f"{label} is a pipe or a device, not a file.", "Put the file itself there.")
    if status.st_size > most:
        raise DataError(f"{label} has {status.st_size:,} bytes; at most {most:,} are read.", "Check the file.")
    return status.st_size


def atomic_write(path: Path, write: Callable[[Path], object]) -> None:
    """Write a file whole or not at all; on any failure `path` stays unchanged.

    Writes through a symbolic link to its target, and keeps the mode of an existing file. Makes the folder if needed.
    `write` gets the path of a temporary file of the same suffix. Raises OSError, which names `path`.
    """
    target = Path(os.path.realpath(path)) if path.is_symlink() else path
    mode = _mode_of(target)
    with errors_naming_path(path):
        target.parent.mkdir(parents=True, exist_ok=True)
        # a separate folder, because libraries create temporary files beside their output
        folder = temporary_folder(target.parent)
    try:
        with errors_naming_path(path, folder):
            temporary = folder / f"new{path.suffix}"  # image and npz writers derive the format from the suffix
            write(temporary)
            with temporary.open("rb+") as stream:
                os.fsync(stream.fileno())
            temporary.chmod(mode)
            replace(temporary, target)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def temporary_folder(parent: Path) -> Path:
    """Create a folder that `remove_temporaries` removes once this process has ended."""
    return Path(tempfile.mkdtemp(prefix=f".karf-{HOST}-{os.getpid()}-", dir=parent))


def copy_file(source: Path, target: Path) -> None:
    """Copy a file atomically. Raises OSError, which names the source or the target."""
    atomic_write(target, lambda temporary: shutil.copyfile(source, temporary))


@contextmanager
def refusing_unreadable(path: Path) -> Iterator[None]:
    """Raise failed reads of the block as DataError that names this file."""
    try:
        yield
    except OSError as error:
        raise DataError(
            "{path} cannot be read: {reason}.", "Check the file.", path=path, reason=error.strerror
        ) from error


@contextmanager
def errors_naming_path(path: Path, folder: Path | None = None) -> Iterator[None]:
    """Raise failed writes of the block as OSError that names this file or folder.

    Errors that name another file themselves pass, such as those of reading a source. `folder` is where the block writes,
    by default that of `path`.
    """
    try:
        yield
    except Exception as error:
        if isinstance(error, KarfError) and error.code != KarfError.code:
            raise
        number = errno_of(error) or _probe(folder or (path if path.is_dir() else path.parent))
        named = getattr(error, "filename", None)
        names_another = named and number not in NO_ROOM and not TEMPORARY.search(str(named))
        if number is None or names_another:
            raise
        raise OSError(number, getattr(error, "strerror", None) or os.strerror(number), str(path)) from error


def replace(source: Path, target: Path) -> None:
    """Rename a file or folder over the target and flush; on Windows, retry while another program has either open."""
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
        mask = os.umask(0)
        os.umask(mask)
        return 0o666 & ~mask
    if not mode & 0o222 or not os.access(target, os.W_OK):  # root could write it all the same
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(target))
    return stat.S_IMODE(mode)


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


@contextmanager
def new_folder(out: Path, may_replace: Callable[[Path], bool] = lambda _: False) -> Iterator[Path]:
    """Yield a temporary folder that is renamed to `out` after the block, or removed if the block fails.

    may_replace: whether this folder, which is not empty, is replaced. Raises BadRequest for others.
    """
    if out.exists() and (not out.is_dir() or (any(out.iterdir()) and not may_replace(out))):
        raise BadRequest(f"{out} already exists and is not empty.", "Give a new folder.")
    out.parent.mkdir(parents=True, exist_ok=True)
    remove_temporaries(out.parent)
    work = temporary_folder(out.parent)
    try:
        folder = work / "new"
        folder.mkdir()
        yield folder
        old = work / "old"
        if out.exists():
            replace(out, old)
        try:
            replace(folder, out)
        except OSError:
            if old.exists():
                replace(old, out)
            raise
    finally:
        shutil.rmtree(work, ignore_errors=True)


def link_or_copy(source: Path, target: Path) -> None:
    """Make a hard link, or a copy on another disk or a file system without links."""
    try:
        os.link(source.resolve(), target)
    except OSError:
        copy_file(source, target)


def checksum(path: Path) -> str:
    """Return the SHA-256 of a file as hexadecimal text. Raises DataError if it is not a regular file."""
    check_file(path)
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def fingerprint(*parts: Any) -> str:
    """Return a hash of JSON values, 16 hexadecimal digits."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]


def file_digest(path: Path) -> list:
    """Return [size, SHA-256] of a file; files over 1 MiB are hashed by their first and last 256 KiB."""
    size = check_file(path)
    with path.open("rb") as stream:
        if size <= WHOLE_BYTES:
            content = stream.read()
        else:
            content = stream.read(END_BYTES)
            stream.seek(-END_BYTES, 2)
            content += stream.read()
    return [size, hashlib.sha256(content).hexdigest()]


def remove_temporaries(folder: Path) -> None:
    """Remove the temporary folders that dead processes of this host left in a folder."""
    with suppress(OSError):  # the folder is missing
        for path in folder.iterdir():
            match = TEMPORARY.fullmatch(path.name)
            if match and match[1] == HOST and not is_running(int(match[2])):
                shutil.rmtree(path, ignore_errors=True)  # follows no links


def is_running(pid: int) -> bool:
    """Test whether a process of this computer has this id."""
    if sys.platform == "win32":  # `os.kill` would end the process
        import ctypes

        kernel = ctypes.WinDLL("kernel32", use_last_error=True)
        handle = kernel.OpenProcess(SYNCHRONIZE, False, pid)
        if not handle:
            return ctypes.get_last_error() != NO_SUCH_PROCESS
        running = kernel.WaitForSingleObject(handle, 0) == STILL_RUNS
        kernel.CloseHandle(handle)
        return running
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:  # another user's
        pass
    return True


@contextmanager
def library_path(path: Path) -> Iterator[str]:
    """Yield a UTF-8 path to a file, which may be missing if its own name is UTF-8.

    On Linux, names that are not UTF-8 are opened here and passed as /dev/fd.
    """
    if _is_utf8(str(path)):
        yield str(path)
        return
    opened, rest = (path.parent, f"/{path.name}") if _is_utf8(path.name) else (path, "")
    handle = os.open(opened, os.O_RDONLY)
    try:
        yield f"/dev/fd/{handle}{rest}"
    finally:
        os.close(handle)


def _is_utf8(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True
