"""Which views a request names: those of a split, by their names, or the cameras of a file."""

from __future__ import annotations

from pathlib import Path

from ..capture import open_capture
from ..capture.capture import View
from ..errors import DataError
from .job import Job


def select_views(job: Job, wanted: str) -> tuple[list[View], bool]:
    """The views that `views` names, and whether they are captured ones.

    Raises DataError where a name is unknown or a split is empty.
    """
    capture = job.capture()
    if wanted in ("train", "test", "val", "all"):
        views = list(capture.split(wanted))
        if not views:
            raise DataError(f"{capture.source} has no {wanted} views.", "Use another split, or all.")
        return views, True
    if wanted.endswith(".json"):
        return list(open_capture(Path(wanted), photos=False).views), False
    return [capture.view(name.strip()) for name in wanted.split(",")], True
