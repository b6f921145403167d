"""Write folders atomically, with links to the files of others."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import BadRequest
from ..io.files import copy_file, remove_temporaries, temporary_folder


@contextmanager
def new_folder(out: Path) -> Iterator[Path]:
    """Yield a temporary folder that is renamed to `out` after the block, or removed if the block fails.

    Raises:
        BadRequest: `out` exists and is not empty.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise BadRequest(f"{out} already exists and is not empty.", "Give a new folder.")
    out.parent.mkdir(parents=True, exist_ok=True)
    remove_temporaries(out.parent)
    work = temporary_folder(out.parent)
    try:
        folder = work / "new"
        folder.mkdir()
        yield folder
        if out.exists():
            out.rmdir()  # it is empty
        folder.replace(out)
    finally:
        shutil.rmtree(work, ignore_errors=True)


def link_or_copy(source: Path, target: Path) -> None:
    """Make a hard link, or a copy on another disk or a file system without links."""
    try:
        os.link(source.resolve(), target)
    except OSError:
        copy_file(source, target)
