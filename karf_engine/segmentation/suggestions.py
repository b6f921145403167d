"""Which views to mark next: those that show most of the surface whose labels are unsure."""

from __future__ import annotations

import numpy as np

from .label_propagation import Labels
from .surface_points import SurfacePoints
from .views import CachedViews

MOST = 8
PLACES = 4  # decimal, of a score


def views_to_mark(cached: CachedViews, points: SurfacePoints, labels: Labels) -> dict[str, float]:
    """The unmarked views that a mark would decide most in, the best first, with their scores.

    A view's score is the mean doubt of its pixels, in [0, 1]: 1 less the margin of the labels that a pixel's ray hits, 0
    where it hits nothing.

    Args:
        cached: the views and the n rays that the points were merged from.
        points: on the surface.
        labels: of the points.
    """
    doubt = (1 - labels.margin)[points.point_of_sample].mean(1) * cached.cache.opacity.cpu().numpy()
    views, offsets = cached.views, cached.views.offsets
    view = np.searchsorted(offsets, cached.cache.index.cpu().numpy(), side="right") - 1
    scores = np.bincount(view, doubt, len(views.plates)) / np.diff(offsets)
    found = {name: round(float(score), PLACES) for name, score in zip(views.names, scores, strict=True)}
    unmarked = [name for name in found if name not in views.masked_names]
    return {name: found[name] for name in sorted(unmarked, key=lambda name: -found[name])[:MOST]}
