"""Suggest the views to mark next: those where one stroke would decide most.

A stroke decides the patch of unsure surface that it is drawn in, in all views. So the unsure points of each object are
joined to patches, separately inside and outside the object. Where a patch is wide enough for a brush in a view, its value
there is the geometric mean of its pixels in all views and in this one, times its mean doubt.

If much is wrong in every view, scores are similar, and a stroke in any view helps about as much.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from ..compute.neighbors import build_kd_tree
from .doubts import DOUBTED
from .point_labels import Labels
from .surface_points import CELL_IN_SPACINGS, SurfacePoints
from .views import CachedViews

MAX_SUGGESTIONS = 8
MIN_RADIUS = 2.0  # pixels from the middle of a patch to its border, for a brush
JOIN_DISTANCE = 2.0  # cells between unsure points of one patch
SIMILAR = 1.37  # ratio of the best to the mean score, below it any view helps; chosen on measured gains


@dataclass(frozen=True)
class Suggestions:
    """The views to mark next.

    Attributes:
        scores: scores in [0, 1] of the best unmarked views by name, the best first.
        any_view_helps: whether any other unmarked view would help about as much.
    """

    scores: dict[str, float]
    any_view_helps: bool


def suggestions_of(scores: Mapping[str, float]) -> Suggestions:
    """Rank the unmarked views by their scores.

    Examples:
        >>> suggestions_of({"front": 0.01, "back": 0.04, "side": 0.01})
        Suggestions(scores={'back': 0.04, 'front': 0.01, 'side': 0.01}, any_view_helps=False)
        >>> suggestions_of({"front": 0.03, "back": 0.04, "side": 0.03}).any_view_helps
        True
    """
    best = sorted(scores, key=lambda name: -scores[name])[:MAX_SUGGESTIONS]
    are_similar = len(best) > 1 and scores[best[0]] * len(scores) < SIMILAR * sum(scores.values())
    return Suggestions({name: scores[name] for name in best}, are_similar)


def views_to_mark(cached: CachedViews, points: SurfacePoints, labels: Labels) -> Suggestions:
    """Score the unmarked views: the mean over the objects of the best patch's value, relative to the object's pixels.

    `points` come from the rays of `cached`, `labels` are theirs.
    """
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
