"""segmentation.json: the views that segmentation used, and the agreement of its result with the coarse masks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeGuard

from torch import Tensor

from ..errors import DataError
from ..io.files import read_json, write_json
from ..io.names import check_names
from ..metrics.masks import iou
from .doubts import ObjectDoubt, unsure_objects
from .point_labels import Labels
from .suggestions import Suggestions, views_to_mark
from .surface_points import SurfacePoints
from .views import CachedViews


@dataclass(frozen=True)
class SegmentationReport:
    """The result of segmentation, for the user and for later stages.

    Attributes:
        objects: names of the objects.
        precision: of each object in [0, 1], see `Labels.precision`.
        iou_with_masks: of each object, IoU in [0, 1] of the rendered and the coarse mask in each view with a mask.
        views: names of the views used, in the order of `ObjectSurface.view`.
        masked_views: names of those with a coarse mask.
        surface_points: number of labelled points.
        unsure: doubt of each object by name; empty in old files.
        suggestions: the views to mark next; none in old files.
    """

    objects: list[str]
    precision: dict[str, float]
    iou_with_masks: dict[str, list[float]]
    views: list[str]
    masked_views: list[str]
    surface_points: int
    unsure: dict[str, ObjectDoubt]
    suggestions: Suggestions

    def write(self, path: Path) -> None:
        """Write the report as JSON, atomically."""
        content = {
            "objects": self.objects,
            "precision": self.precision,
            "iou_with_marks": self.iou_with_masks,
            "views": self.views,
            "marked": self.masked_views,
            "surface_points": self.surface_points,
            "unsure": {name: asdict(each) for name, each in self.unsure.items()},
            "suggestions": self.suggestions.scores,
            "any_view_helps": self.suggestions.any_view_helps,
        }
        write_json(path, content)

    @classmethod
    def read(cls, path: Path) -> SegmentationReport:
        """Read what `write` wrote. Raises DataError where the file is missing or damaged."""
        content = read_json(path, "report")
        if not isinstance(content, dict):
            raise _damaged(path, "no table of values")
        views = check_names(content.get("views"), path, "a view")
        masked_views = check_names(content.get("marked"), path, "a view")
        objects = check_names(content.get("objects"), path, "an object")
        precision, agreement = content.get("precision"), content.get("iou_with_marks")
        if not _is_table(precision, objects, _is_share):
            raise _damaged(path, "no precision of each object")
        if not _is_table(agreement, objects, _are_shares):
            raise _damaged(path, "no agreement of each object with its masks")
        surface_points = content.get("surface_points")
        if type(surface_points) is not int or surface_points < 0:
            raise _damaged(path, "no number of surface points")
        unsure = content.get("unsure", {})
        if not _is_table(unsure, None, _is_unsure):
            raise _damaged(path, "no doubts of objects")
        unsure = {name: ObjectDoubt(**each) for name, each in unsure.items()}
        scores, any_view_helps = content.get("suggestions", {}), content.get("any_view_helps", False)
        if not _is_table(scores, None, _is_share):
            raise _damaged(path, "no scores of views")
        if not isinstance(any_view_helps, bool):
            raise _damaged(path, "no word on whether any view helps")
        suggestions = Suggestions(scores, any_view_helps)
        return cls(objects, precision, agreement, views, masked_views, surface_points, unsure, suggestions)


def report_of(cached: CachedViews, points: SurfacePoints, labels: Labels, probabilities: Tensor) -> SegmentationReport:
    """Compare a segmentation with its masks.

    Args:
        cached: views, masks, and n cached rays.
        points: surface points of the rays.
        labels: of the points.
        probabilities: [n, K+1], of the rays as F_s renders them.
    """
    views = cached.views
    pictures = cached.pictures(probabilities.argmax(1).cpu().numpy())
    agreement: dict[str, list[float]] = {name: [] for name in views.objects}
    for picture, masks in zip(pictures, views.masks, strict=True):
        for k, mask in masks.items():
            agreement[views.objects[k - 1]].append(round(iou(picture == k, mask), 4))
    return SegmentationReport(
        objects=views.objects,
        precision={name: round(float(p), 4) for name, p in zip(views.objects, labels.precision, strict=True)},
        iou_with_masks=agreement,
        views=views.names,
        masked_views=views.masked_names,
        surface_points=len(labels.probabilities),
        unsure=unsure_objects(cached, points, labels),
        suggestions=views_to_mark(cached, points, labels),
    )


def _damaged(path: Path, reason: str) -> DataError:
    return DataError(f"{path} (report) holds {reason}.", "Run the segmentation stage again.")


def _is_table(value: Any, names: list[str] | None, fits: Callable[[Any], bool]) -> TypeGuard[dict[str, Any]]:
    """Return whether a value is a dict of these names, or of any names, whose values fit."""
    return isinstance(value, dict) and (names is None or set(value) == set(names)) and all(map(fits, value.values()))


def _is_share(value: Any) -> bool:
    return isinstance(value, int | float) and 0 <= value <= 1


def _is_unsure(value: Any) -> bool:
    return isinstance(value, dict) and set(value) == {"share", "unseen"} and all(map(_is_share, value.values()))


def _are_shares(values: Any) -> bool:
    return isinstance(values, list) and all(map(_is_share, values))
