"""Prompts: a box, clicks or a lasso that mark an object in a photo (numpy only)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from ...errors import BadRequest

Box = tuple[float, float, float, float]
Point = tuple[float, float]


@dataclass(frozen=True)
class Prompts:
    """Prompts in pixels of the photo as stored: x to the right, y down, centers of pixels at .5."""

    box: Box | None = None  # (x0, y0, x1, y1), a frame around the object
    points: tuple[tuple[float, float, bool], ...] = ()  # clicks (x, y, is_object) in their order
    lasso: tuple[Point, ...] | None = None  # at least three corners (x, y) of a closed line around the object

    @classmethod
    def from_json(cls, content: Any) -> Prompts:
        """Parse `{"box": [x0, y0, x1, y1], "points": [[x, y, is_object], ..], "lasso": [[x, y], ..]}`.

        Each key may be missing or null. Raises BadRequest for anything else.
        """
        try:
            box, points, lasso = (content.get(name) for name in ("box", "points", "lasso"))
            return cls(
                None if box is None else cast(Box, _numbers(box, 4)),
                tuple((*_point(click[:2]), bool(click[2])) for click in points or ()),
                tuple(map(_point, lasso)) if lasso else None,
            )
        except (AttributeError, TypeError, ValueError, IndexError, KeyError) as error:
            raise BadRequest(
                f"{content!r:.200} is not a box, clicks or a lasso.",
                "Give numbers: box [x0, y0, x1, y1], points [[x, y, is_object], ...], lasso [[x, y], ...].",
            ) from error

    def to_json(self) -> dict[str, Any]:
        return {
            "box": None if self.box is None else list(self.box),
            "points": [list(point) for point in self.points],
            "lasso": None if self.lasso is None else [list(corner) for corner in self.lasso],
        }

    def check(self, width: int, height: int) -> None:
        """Raise BadRequest if the prompts are empty or do not fit a photo of this size."""
        if self.box is None and self.lasso is None and not any(is_object for *_, is_object in self.points):
            raise BadRequest("Nothing says where the object is.", "Draw a box or a lasso around it, or click on it.")
        for x, y, _ in self.points:
            if not (0 <= x < width and 0 <= y < height):
                raise BadRequest(
                    f"The click at {x:g}, {y:g} lies outside the photo of {width}x{height} pixels.",
                    "Click in the photo.",
                )
        if self.box is not None and not _overlap(np.reshape(self.box, (2, 2)), width, height):
            raise BadRequest(
                f"The box {', '.join(f'{value:g}' for value in self.box)} holds nothing of the photo of {width}x{height} "
                "pixels.",
                "Give its left, top, right and bottom.",
            )
        if self.lasso is not None and not (
            len(self.lasso) >= 3 and _overlap(np.stack([np.min(self.lasso, 0), np.max(self.lasso, 0)]), width, height)
        ):
            raise BadRequest("The lasso goes around nothing of the photo.", "Draw it around the object.")


def _numbers(values: Any, count: int) -> tuple[float, ...]:
    numbers = tuple(float(value) for value in values)
    if len(numbers) != count or not np.isfinite(numbers).all():
        raise ValueError(f"not {count} numbers")
    return numbers


def _point(values: Any) -> Point:
    return cast(Point, _numbers(values, 2))


def _overlap(extent: np.ndarray, width: int, height: int) -> bool:
    """Return whether a frame [[x0, y0], [x1, y1]] overlaps a picture."""
    low, high = np.maximum(extent[0], 0), np.minimum(extent[1], (width, height))
    return bool((high > low).all())
