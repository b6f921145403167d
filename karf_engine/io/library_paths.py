"""Paths for C libraries that accept UTF-8 only."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import OpenEXR


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


def save_exr(file: OpenEXR.File, path: Path) -> None:
    """Write an EXR file. Raises RuntimeError if it cannot be written."""
    with library_path(path) as writable:
        file.write(writable)
