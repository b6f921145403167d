"""Select views by split, by name or from a camera file, and a range of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..errors import BadRequest, DataError
from . import open_capture
from .capture import Capture, View


def choose_views(capture: Capture, wanted: str) -> tuple[list[View], bool]:
    """Return the wanted views, and whether they belong to the capture.

    Args:
        capture: The capture.
        wanted: `train`, `test`, `val`, `all`, comma-separated names, or the path of a CAMERAS.json.

    Raises:
        DataError: A name is unknown or a split is empty.
    """
    if wanted in ("train", "test", "val", "all"):
        views = list(capture.split(wanted))
        if not views:
            raise DataError(f"{capture.source} has no {wanted} views.", "Use another split, or all.")
        return views, True
    if wanted.endswith(".json"):
        return list(open_capture(Path(wanted), photos=False).views), False
    return [capture.view(name.strip()) for name in wanted.split(",")], True


def slice_of_views(views: Sequence, first: int | None, last: int | None, count: int | None) -> slice:
    """Return the slice of views from number `first` to `last` (from 1, both included), at most `count` of them.

    Raises:
        BadRequest: The slice is empty.

    Examples:
        >>> "abcdefgh"[slice_of_views("abcdefgh", 4, 8, 3)]
        'def'
    """
    start = (1 if first is None else first) - 1
    ends = [len(views), *([last] if last is not None else []), *([start + count] if count is not None else [])]
    if not 0 <= start < min(ends):
        raise BadRequest(
            f"There are {len(views)} views; from number {start + 1} to {min(ends)} there are none.",
            "Views are counted from 1.",
        )
    return slice(start, min(ends))
