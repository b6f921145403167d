"""What is said of files that the system refuses, and what a failed job wrote last. No bpy."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..engine_api import LOG_FILE, DataError

LOG_LINES = 30
LOG_BYTES = 20_000  # lines may be long


def log_tail(folder: Path) -> str:
    """The last lines of a job's log; empty where there is none. Never raises."""
    try:
        with (folder / LOG_FILE).open("rb") as stream:
            stream.seek(max(0, stream.seek(0, 2) - LOG_BYTES))
            lines = stream.read().decode("utf-8", "replace").splitlines()
    except OSError:
        return ""
    return "\n".join(lines[-LOG_LINES:])


def disk_error(error: OSError) -> DataError:
    """What the operating system refuses, as a sentence that names the file."""
    return DataError(
        f"{error.filename or 'The disk'}: {error.strerror or error}.",
        "Check free space, the drive's connection and your write permission, or choose another folder.",
    )


@contextmanager
def disk_errors() -> Iterator[None]:
    """Turn what the operating system refuses inside this block into a DataError."""
    try:
        yield
    except OSError as error:
        raise disk_error(error) from error
