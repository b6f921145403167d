"""segmentation.json: the views that segmentation used, how its result agrees with the masks, and the views to mark next.

The best view to mark is the one where a stroke decides most. A stroke decides the patch of unsure surface that it is drawn
in, in all views. So the unsure points of each object are joined to patches, separately inside and outside the object. Where
a patch is wide enough for a brush in a view, its value there is the geometric mean of its pixels in all views and in this
one, times its mean doubt. If much is wrong in every view, scores are similar, and a stroke in any view helps about as much.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from torch import Tensor

from ..compute.neighbors import build_kd_tree
from ..errors import DataError
from ..io.files import read_json, write_json
from ..io.names import check_names
from ..metrics.masks import iou
from .surface_points import CELL_IN_SPACINGS, DOUBTED, Labels, ObjectDoubt, SurfacePoints, unsure_objects
from .views import CachedViews


@dataclass(frozen=True)
class SegmentationReport:
    """The result of segmentation, for the user and for later stages."""

    objects: list[str]
    precision: dict[str, float]  # of each object in [0, 1], see `Labels.precision`
    iou_with_masks: dict[str, list[float]]  # of each object, of the rendered and the coarse mask in each view with one
    views: list[str]  # names, in the order of `ObjectSurface.view`
    masked_views: list[str]  # names of those with a coarse mask
    surface_points: int  # number of labelled points
    unsure: dict[str, ObjectDoubt]  # by object; empty in old files
    suggestions: Suggestions  # none in old files

    def write(self, path: Path) -> None:
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

    points: of the n cached rays. labels: of the points. probabilities: [n, K+1], of the rays as F_s renders them.
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


MAX_SUGGESTIONS = 8
MIN_RADIUS = 2.0  # pixels from the middle of a patch to its border, for a brush
JOIN_DISTANCE = 2.0  # cells between unsure points of one patch
SIMILAR = 1.37  # ratio of the best to the mean score, below it any view helps; chosen on measured gains


@dataclass(frozen=True)
class Suggestions:
    """The views to mark next."""

    scores: dict[str, float]  # in [0, 1], of the best unmarked views by name, the best first
    any_view_helps: bool  # whether any other unmarked view would help about as much


def suggestions_of(scores: Mapping[str, float]) -> Suggestions:
    """Rank the unmarked views by their scores."""
    best = sorted(scores, key=lambda name: -scores[name])[:MAX_SUGGESTIONS]
    are_similar = len(best) > 1 and scores[best[0]] * len(scores) < SIMILAR * sum(scores.values())
    return Suggestions({name: scores[name] for name in best}, are_similar)


def views_to_mark(cached: CachedViews, points: SurfacePoints, labels: Labels) -> Suggestions:
    """Score the unmarked views: the mean over the objects of the best patch's value, relative to the object's pixels."""
    views, end = cached.views, points.point_of_sample[:, points.point_of_sample.shape[1] // 2]
    pixels, scores = np.bincount(end, minlength=len(points)), np.zeros(len(views.training_images))
    for k, doubt in enumerate(labels.doubt.T, 1):
        patch = _patches(points, np.where(doubt > DOUBTED, 1 + (labels.classes == k), 0))
        total = np.maximum(np.bincount(patch, pixels), 1)
        object_pixels = max((pixels * labels.opinion[:, k]).sum(), 1)
        value = np.sqrt(total) * np.bincount(patch, pixels * doubt) / total / object_pixels
        best = [_best_value(picture, value) for picture in cached.pictures(patch[end])]
        scores += np.minimum(best, 1) / len(views.objects)
    found = {name: round(float(score), 4) for name, score in zip(views.names, scores, strict=True)}
    return suggestions_of({name: score for name, score in found.items() if name not in views.masked_names})


def _patches(points: SurfacePoints, kind: np.ndarray) -> np.ndarray:
    """Return the patch number of each point, [p], 0 for none. kind: [p], equal within a patch, 0 for no patch."""
    patch, chosen = np.zeros(len(kind), int), np.flatnonzero(kind)
    if len(chosen):
        tree = build_kd_tree(points.positions[chosen], balanced_tree=False, compact_nodes=False)
        first, second = tree.query_pairs(JOIN_DISTANCE * CELL_IN_SPACINGS * points.spacing, output_type="ndarray").T
        same = kind[chosen[first]] == kind[chosen[second]]
        tied = coo_matrix((same, (first, second)), (len(chosen), len(chosen)))
        tied.eliminate_zeros()
        patch[chosen] = 1 + connected_components(tied, directed=False)[1]
    return patch


def _best_value(picture: np.ndarray, value: np.ndarray) -> float:
    """Return the largest value of a patch in a view. picture: [H, W] patch numbers; value: per root of its pixels here."""
    numbers, counts = np.unique(picture, return_counts=True)
    large = (numbers > 0) & (counts >= MIN_RADIUS**2)
    best = 0.0
    for number, count in zip(numbers[large], counts[large], strict=True):
        here = value[number] * np.sqrt(count)
        if here > best and np.asarray(distance_transform_edt(np.pad(picture == number, 1))).max() >= MIN_RADIUS:
            best = here
    return best
