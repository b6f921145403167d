"""Files written whole or not at all, JSON, and checksums: the base of every module that touches the disk.

A file is written to a temporary name, flushed to disk and renamed, so that a killed process leaves the last good state.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..errors import DataError
from .inputs import MOST_JSON, check_file

TEMPORARY = ".tmp"  # prefix of the names of temporary files, safetensors' own included
STALE_SECONDS = 3600.0  # age at which a temporary file is no longer being written
HELD = (5, 32, 33, 1224)  # Windows errors: access denied, sharing violation, lock violation, mapped by a process
HELD_SECONDS = 3.0  # for which virus scanners, indexers and thumbnails hold a new file there, at most


def atomic_write(path: Path, write: Callable[[Path], None]) -> None:
    """Write a file whole or not at all; on any failure `path` stays as it was.

    Args:
        path: The file; its folder is made.
        write: Called with the path of a temporary file of the same suffix, which is then flushed to disk and renamed.

    Raises:
        OSError: The disk takes no more, or the folder cannot be written.

    Examples:
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     atomic_write(Path(folder) / "note.txt", lambda temporary: temporary.write_text("done"))
        ...     (Path(folder) / "note.txt").read_text()
        'done'
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    # keep the suffix: image and npz writers choose the format by it. Nothing else of the name: it may be of full length
    handle, name = tempfile.mkstemp(prefix=TEMPORARY, suffix=path.suffix, dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        write(temporary)
        with temporary.open("rb+") as stream:
            os.fsync(stream.fileno())
        temporary.chmod(0o666 & ~_umask())
        replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def replace(source: Path, target: Path) -> None:
    """Give a file or folder another name, over what had it; on Windows, wait while another program holds either.

    Raises:
        OSError: It cannot be renamed, or is held for more than `HELD_SECONDS`.
    """
    patient_until = time.monotonic() + HELD_SECONDS
    while True:
        try:
            source.replace(target)
            return
        except OSError as error:
            if getattr(error, "winerror", None) not in HELD or time.monotonic() > patient_until:
                raise
        time.sleep(0.05)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def write_json(path: Path, content: Any) -> None:
    """Write JSON atomically, indented so that a person can read it; the same bytes on every system.

    Raises:
        ValueError: A number in it is not finite.
    """
    text = json.dumps(content, indent=1, allow_nan=False)
    atomic_write(path, lambda temporary: temporary.write_text(text + "\n", encoding="utf-8", newline="\n"))


def read_json(path: Path, what: str) -> Any:
    """Read a JSON file.

    Args:
        path: The file.
        what: What messages call it.

    Raises:
        DataError: The file is missing, too large, or not JSON; names the line and the reason.
    """
    check_file(path, MOST_JSON, f"{path} ({what})")
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
    except (OSError, ValueError, RecursionError) as error:  # no text, numbers without end, brackets without end
        raise DataError(f"{path} ({what}) cannot be read: {error}.", "Check the file.") from error


def checksum(path: Path) -> str:
    """SHA-256 of a file's bytes, as hexadecimal text."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def remove_temporaries(folder: Path, older_than: float = STALE_SECONDS) -> None:
    """Delete temporary files that killed processes left in a folder, once they are this many seconds old."""
    for path in folder.glob(f"{TEMPORARY}*"):
        if time.time() - path.stat().st_mtime >= older_than:
            path.unlink(missing_ok=True)
