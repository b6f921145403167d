"""What a user marks in a photo to point out an object (numpy only)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import BadRequest

FEWEST_CORNERS = 3


@dataclass(frozen=True)
class Prompts:
    """Marks in a photo, in its pixels as stored: x to the right, y down, centers of pixels at .5.

    Attributes:
        box: (x0, y0, x1, y1), a frame that the object lies in; None where none is drawn.
        points: Clicks (x, y, is_object) in the order in which they were made: on the object, or on what is not.
        lasso: Corners (x, y) of a closed line around the object, at least three; None where none is drawn.
    """

    box: tuple[float, float, float, float] | None = None
    points: tuple[tuple[float, float, bool], ...] = ()
    lasso: tuple[tuple[float, float], ...] | None = None

    @classmethod
    def from_json(cls, content: Any) -> Prompts:
        """The prompts of `{"box": [x0, y0, x1, y1], "points": [[x, y, is_object], ..], "lasso": [[x, y], ..]}`.

        Each may be left out or null. Raises BadRequest where it is anything else.

        Examples:
            >>> Prompts.from_json({"points": [[4.5, 2.5, True]]}).points
            ((4.5, 2.5, True),)
        """
        try:
            box, points, lasso = (content.get(name) for name in ("box", "points", "lasso"))
            prompts = cls(
                None if box is None else tuple(_numbers(box, 4)),
                tuple((*_numbers(point[:2], 2), bool(point[2])) for point in points or ()),
                tuple(tuple(_numbers(corner, 2)) for corner in lasso) if lasso else None,
            )
        except (AttributeError, TypeError, ValueError, IndexError, KeyError) as error:
            raise BadRequest(
                f"{content!r:.200} is not a box, clicks or a lasso.",
                "Give numbers: box [x0, y0, x1, y1], points [[x, y, is_object], ...], lasso [[x, y], ...].",
            ) from error
        return prompts

    def to_json(self) -> dict[str, Any]:
        """What `from_json` reads."""
        return {
            "box": None if self.box is None else list(self.box),
            "points": [list(point) for point in self.points],
            "lasso": None if self.lasso is None else [list(corner) for corner in self.lasso],
        }

    def check(self, width: int, height: int) -> None:
        """Raises BadRequest where they cannot be prompts of a photo of this size, or are empty."""
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
            len(self.lasso) >= FEWEST_CORNERS and _overlap(_extent(np.array(self.lasso)), width, height)
        ):
            raise BadRequest("The lasso goes around nothing of the photo.", "Draw it around the object.")


def _numbers(values: Any, count: int) -> list[float]:
    numbers = [float(value) for value in values]
    if len(numbers) != count or not np.isfinite(numbers).all():
        raise ValueError(f"not {count} numbers")
    return numbers


def _extent(corners: np.ndarray) -> np.ndarray:
    return np.stack([corners.min(0), corners.max(0)])


def _overlap(extent: np.ndarray, width: int, height: int) -> bool:
    """Whether a frame [[x0, y0], [x1, y1]] holds a part of a picture."""
    low, high = np.maximum(extent[0], 0), np.minimum(extent[1], (width, height))
    return bool((high > low).all())
