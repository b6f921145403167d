"""segmentation.json: the views used by segmentation, the agreement with their masks, and the views to mark next.

The best view to mark is the one where a stroke decides most. A stroke decides the patch of unsure surface that it is
drawn in, in all views. So the unsure points of each object are joined to patches, separately inside and outside the
object. Where a patch is wide enough for a brush in a view, its value there is the geometric mean of its pixels in all
views and in this one, times its mean doubt. If much is wrong in every view, scores are similar, and a stroke in any
view helps about as much.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from itertools import chain
from pathlib import Path

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from torch import Tensor

from ..compute.neighbors import build_kd_tree
from ..errors import DataError
from ..io.arguments import check_fields
from ..io.files import read_json, write_json
from ..io.names import check_names
from ..metrics.masks import iou
from .surface_points import CELL_IN_SPACINGS, DOUBTED, Labels, ObjectDoubt, SurfacePoints, unsure_objects
from .views import CachedViews

MAX_SUGGESTIONS = 8
MIN_RADIUS = 2.0  # pixels from the middle of a patch to its border, for a brush
JOIN_DISTANCE = 2.0  # cells between unsure points of one patch
SIMILAR = 1.37  # ratio of the best to the mean score, below it any view helps; chosen on measured gains


@dataclass(frozen=True)
class Suggestions:
    """The views to mark next."""

    scores: dict[str, float]  # in [0, 1], of the best unmarked views by name, the best first
    any_view_helps: bool  # whether any other unmarked view would help about as much


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
    centers: dict[str, list[float]]  # of objects with points, [3] world coordinates; empty in old files

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
            "centers": self.centers,
        }
        write_json(path, content)

    @classmethod
    def read(cls, path: Path) -> SegmentationReport:
        """Read what `write` wrote. Raises DataError where the file is missing or damaged."""
        content = read_json(path, "report")
        content = content if isinstance(content, dict) else {}
        keys = (("objects", "an object"), ("views", "a view"), ("marked", "a view"))
        objects, views, masked_views = (check_names(content.get(key), path, what) for key, what in keys)
        try:
            precision, agreement = content["precision"], content["iou_with_marks"]
            unsure = {name: ObjectDoubt(**each) for name, each in content.get("unsure", {}).items()}
            suggestions = Suggestions(content.get("suggestions", {}), content.get("any_view_helps", False))
            centers, n_points = content.get("centers", {}), content["surface_points"]
            report = cls(objects, precision, agreement, views, masked_views, n_points, unsure, suggestions, centers)
            for part in (report, suggestions, *unsure.values()):
                check_fields(part)
            shares = [*precision.values(), *chain(*agreement.values()), *suggestions.scores.values()]
            shares += [share for each in unsure.values() for share in (each.share, each.unseen)]
            if set(precision) != set(objects) or set(agreement) != set(objects):
                raise ValueError("other objects")
            if not all(len(center) == 3 and np.isfinite(center).all() for center in centers.values()):
                raise ValueError("centers that are no places")
            if report.surface_points < 0 or not all(0 <= share <= 1 for share in shares):
                raise ValueError("numbers out of range")
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise DataError(f"{path} (report) is damaged ({error}).", "Run the segmentation stage again.") from error
        return report


def report_of(
    cached: CachedViews, points: SurfacePoints, labels: Labels, probabilities: Tensor, world: np.ndarray
) -> SegmentationReport:
    """Compare a segmentation with its masks.

    points: of the n cached rays. labels: of the points. probabilities: [n, K+1], of the rays as F_s renders them.
    world: [p, 3], the points in world coordinates.
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
        centers={
            name: np.median(world[own], axis=0).tolist()
            for k, name in enumerate(views.objects, 1)
            if (own := labels.classes == k).any()
        },
    )


def views_to_mark(cached: CachedViews, points: SurfacePoints, labels: Labels) -> Suggestions:
    """Score the unmarked views: the mean over objects of the best patch's value, relative to the object's pixels."""
    views, end = cached.views, points.point_of_sample[:, points.point_of_sample.shape[1] // 2]
    pixels, scores = np.bincount(end, minlength=len(points)), np.zeros(len(views.training_images))
    for k, doubt in enumerate(labels.doubt.T, 1):
        patch = _patches(points, np.where(doubt > DOUBTED, 1 + (labels.classes == k), 0))
        total = np.maximum(np.bincount(patch, pixels), 1)
        object_pixels = max((pixels * labels.opinion[:, k]).sum(), 1)
        value = np.sqrt(total) * np.bincount(patch, pixels * doubt) / total / object_pixels
        values = [_best_value(picture, value) for picture in cached.pictures(patch[end])]
        scores += np.minimum(values, 1) / len(views.objects)
    found = {name: round(float(score), 4) for name, score in zip(views.names, scores, strict=True)}
    unmarked = {name: score for name, score in found.items() if name not in views.masked_names}
    best = sorted(unmarked, key=lambda name: -unmarked[name])[:MAX_SUGGESTIONS]
    are_similar = len(best) > 1 and unmarked[best[0]] * len(unmarked) < SIMILAR * sum(unmarked.values())
    return Suggestions({name: unmarked[name] for name in best}, are_similar)


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
    """Return the largest value of a patch in a view. picture: [H, W] patch numbers; value: by root of its pixels."""
    numbers, counts = np.unique(picture, return_counts=True)
    large = (numbers > 0) & (counts >= MIN_RADIUS**2)
    best = 0.0
    for number, count in zip(numbers[large], counts[large], strict=True):
        here = value[number] * np.sqrt(count)
        if here > best and np.asarray(distance_transform_edt(np.pad(picture == number, 1))).max() >= MIN_RADIUS:
            best = here
    return best
