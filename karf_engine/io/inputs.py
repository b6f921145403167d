"""Check files from outside before they are opened: opening a pipe blocks, and reading a device never ends."""

from __future__ import annotations

import stat
from pathlib import Path

from ..errors import DataError

MAX_JSON_BYTES = 32 << 20  # bytes; parsed objects take up to thirty times as much
MOST_BYTES = 8 << 30  # bytes of a file that is read whole


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
