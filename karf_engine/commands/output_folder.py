"""Write folders atomically."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import BadRequest


@contextmanager
def new_folder(out: Path) -> Iterator[Path]:
    """Yield a temporary folder that is renamed to `out` after the block, or removed if the block fails.

    Raises:
        BadRequest: `out` exists and is not empty.
    """
    from ..capture.poses.work_folder import work_folder  # needs filelock

    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise BadRequest(f"{out} already exists and is not empty.", "Give a new folder.")
    out.parent.mkdir(parents=True, exist_ok=True)
    with work_folder(out.parent, f".{out.name[:100]}-") as work:
        folder = work / "capture"
        folder.mkdir()
        yield folder
        if out.exists():
            out.rmdir()  # it is empty
        folder.replace(out)
