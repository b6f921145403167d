"""Which views a request names: those of a split, by their names, or the cameras of a file; and which part of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..errors import BadRequest, DataError
from . import open_capture
from .capture import Capture, View


def choose_views(capture: Capture, wanted: str) -> tuple[list[View], bool]:
    """The views that `wanted` names, and whether they are captured ones.

    Args:
        capture: The capture.
        wanted: `train`, `test`, `val`, `all`, names with commas, or the path of a CAMERAS.json.

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


def part_of(views: Sequence, first: int | None, last: int | None, count: int | None) -> slice:
    """Which part of some views a request asks for.

    Args:
        views: All of them.
        first: The first one's number, from 1.
        last: The last one's number; beyond the end: the end.
        count: How many at most.

    Raises:
        BadRequest: The part is empty.

    Examples:
        >>> "abcdefgh"[part_of("abcdefgh", 4, 8, 3)]
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
