"""Checks of files that others made, before they are opened: opening a pipe would wait, reading a device never ends."""

from __future__ import annotations

import stat
from pathlib import Path

from ..errors import DataError

MOST_JSON = 32 << 20  # bytes; as Python objects up to thirty times as much
MOST_BYTES = 8 << 30  # of a file that is read whole


def check_file(path: Path, most: int = MOST_BYTES, label: str = "") -> int:
    """The size in bytes of a regular file, its links followed.

    Args:
        path: The file.
        most: Bytes that it may have.
        label: What messages call it, by default its path.

    Raises:
        DataError: The file is missing, is a folder, a pipe or a device, or has more bytes.
    """
    label = label or str(path)
    try:
        found = path.stat()
    except FileNotFoundError as error:
        raise DataError("{path} does not exist.", "Check the path.", path=label) from error
    except (OSError, ValueError) as error:  # a loop of links, a name that no disk can hold
        raise DataError(
            "{path} cannot be read: {reason}.", "Check the path.", path=label, reason=getattr(error, "strerror", error)
        ) from error
    if stat.S_ISDIR(found.st_mode):
        raise DataError(f"{label} is a folder, not a file.", "Check the path.")
    if not stat.S_ISREG(found.st_mode):
        raise DataError(f"{label} is a pipe or a device, not a file.", "Put the file itself there.")
    if found.st_size > most:
        raise DataError(f"{label} has {found.st_size:,} bytes; at most {most:,} are read.", "Check the file.")
    return found.st_size
