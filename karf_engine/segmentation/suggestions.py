"""Which views to mark next: those where one stroke would decide most.

A stroke decides the patch of unsure surface that it is drawn in, in all views. So of each object the unsure points are
joined to patches, each of what the labels call it or of what they do not. A patch counts in a view where it is wide
enough to be hit with a brush, as the geometric mean of the pixels that show it in all views and in this one, times its
mean doubt: the former is what the stroke decides, the latter how likely it is drawn there, and runs through all of it.

Often much is wrong in every view. Then views score alike, and a stroke in any of them helps about as much.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from ..compute.neighbors import tree_of
from .doubts import DOUBTED
from .point_labels import Labels
from .surface_points import CELL_IN_SPACINGS, SurfacePoints
from .views import CachedViews

MOST = 8
PLACES = 4  # decimal places of a score
WIDE = 2.0  # pixels from the middle of a patch to its border
JOINED = 2.0  # distance in cells within which unsure points are of one patch
# Below, the best score over the mean score says that any view helps. Chosen on the demo and seeds 0 to 7: views that differ
# by less gain 1.1 times what a random view does, the others twice as much.
ALIKE = 1.37


@dataclass(frozen=True)
class Suggestions:
    """Which views to mark next.

    Attributes:
        scores: the unmarked views that a mark would decide most in, the best first, each with its score in [0, 1].
        any_view_helps: whether a mark in any other unmarked view would decide about as much.
    """

    scores: dict[str, float]
    any_view_helps: bool


def suggestions_of(scores: Mapping[str, float]) -> Suggestions:
    """What the scores of all unmarked views suggest.

    Examples:
        >>> suggestions_of({"front": 0.01, "back": 0.04, "side": 0.01})
        Suggestions(scores={'back': 0.04, 'front': 0.01, 'side': 0.01}, any_view_helps=False)
        >>> suggestions_of({"front": 0.03, "back": 0.04, "side": 0.03}).any_view_helps
        True
    """
    best = sorted(scores, key=lambda name: -scores[name])[:MOST]
    is_alike = len(best) > 1 and scores[best[0]] * len(scores) < ALIKE * sum(scores.values())
    return Suggestions({name: scores[name] for name in best}, is_alike)


def views_to_mark(cached: CachedViews, points: SurfacePoints, labels: Labels) -> Suggestions:
    """The unmarked views that a mark would decide most in.

    A score is the mean over the objects of what the best patch counts, in parts of the pixels that show the object.

    Args:
        cached: the views and the n rays that the points were merged from.
        points: on the surface.
        labels: of the points.
    """
    views, end = cached.views, points.point_of_sample[:, points.point_of_sample.shape[1] // 2]
    pixels, scores = np.bincount(end, minlength=len(points)), np.zeros(len(views.training_images))
    for k, doubt in enumerate(labels.doubt.T, 1):
        patch = _patches(points, np.where(doubt > DOUBTED, 1 + (labels.classes == k), 0))
        total = np.maximum(np.bincount(patch, pixels), 1)
        worth = (
            np.sqrt(total) * np.bincount(patch, pixels * doubt) / total / max((pixels * labels.opinion[:, k]).sum(), 1)
        )
        best = [_best(picture, worth) for picture in cached.pictures(patch[end])]
        scores += np.minimum(best, 1) / len(views.objects)
    found = {name: round(float(score), PLACES) for name, score in zip(views.names, scores, strict=True)}
    return suggestions_of({name: score for name, score in found.items() if name not in views.masked_names})


def _patches(points: SurfacePoints, kind: np.ndarray) -> np.ndarray:
    """Number of the patch of each point, [p], 0 where there is none. kind: [p], alike in a patch; 0 is in none."""
    patch, chosen = np.zeros(len(kind), int), np.flatnonzero(kind)
    if len(chosen):
        tree = tree_of(points.positions[chosen], balanced_tree=False, compact_nodes=False)
        first, second = tree.query_pairs(JOINED * CELL_IN_SPACINGS * points.spacing, output_type="ndarray").T
        same = kind[chosen[first]] == kind[chosen[second]]
        tied = coo_matrix((same, (first, second)), (len(chosen), len(chosen)))
        tied.eliminate_zeros()
        patch[chosen] = 1 + connected_components(tied, directed=False)[1]
    return patch


def _best(picture: np.ndarray, worth: np.ndarray) -> float:
    """What the best patch of a view counts. picture: [H, W] patches; worth: of each, times the root of its pixels here."""
    numbers, counts = np.unique(picture, return_counts=True)
    large = (numbers > 0) & (counts >= WIDE**2)
    best = 0.0
    for number, count in zip(numbers[large], counts[large], strict=True):
        value = worth[number] * np.sqrt(count)
        if value > best and distance_transform_edt(np.pad(picture == number, 1)).max() >= WIDE:
            best = value
    return best
