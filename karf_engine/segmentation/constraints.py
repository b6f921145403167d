"""Turn corrections into the classes that surface points may have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch

from ..capture.camera import Camera
from ..capture.capture import View
from ..compute.neighbors import build_kd_tree
from ..fields.protocol import Field
from ..fields.rendering.rays import camera_rays
from ..fields.rendering.surface_cache import SurfaceCache, cache_surface
from .coarse_masks import CoarseMask
from .corrections import NOT_OBJECT, OBJECT, load_correction
from .surface_points import LABEL_SAMPLES, SurfacePoints
from .views import CACHE_STEP
from .votes import vote_on_points

MAX_DISTANCE = 4.0  # point spacings from a sample to its point
MIN_SOLIDITY = 0.5  # of a ray that constrains points, relative to the view's median: silhouette rays are below


@dataclass(frozen=True)
class Constraints:
    """The classes that corrections require or forbid for p surface points.

    Attributes:
        targets: [p, K+1] shares of the allowed classes; rows sum to 1.
        fixed: [p] bool, the constrained points.
    """

    targets: np.ndarray
    fixed: np.ndarray


def correction_targets(strokes: Mapping[int, np.ndarray], n_classes: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the classes that the corrected pixels of one view may have.

    Args:
        strokes: {class number: int8 [H, W]}, at least one.
        n_classes: K + 1, background included.

    Returns:
        Shares of the classes [H, W, n_classes], which sum to 1, and the corrected pixels, bool [H, W].
    """
    shape = next(iter(strokes.values())).shape
    required, allowed = np.zeros((*shape, n_classes)), np.ones((*shape, n_classes))
    for number, values in strokes.items():
        required[..., number] = values == OBJECT
        allowed[..., number] = values != NOT_OBJECT
    targets = np.where(required.any(2, keepdims=True), required, allowed)
    return targets / targets.sum(2, keepdims=True), np.logical_or.reduce([values != 0 for values in strokes.values()])


@dataclass(frozen=True)
class Observation:
    """The surface points that one view shows.

    Attributes:
        size: height and width, pixels.
        cache: the view's n rays.
        point_of_sample: [n, S], -1 where no point is near.
    """

    size: tuple[int, int]
    cache: SurfaceCache
    point_of_sample: np.ndarray


class ViewObserver:
    """Find the surface points that single views show; each view is traced once."""

    def __init__(self, scene_field: Field, points: SurfacePoints, long_side: int) -> None:
        """Take a frozen field, its surface points and the working size in pixels."""
        self._field, self._points, self._long_side = scene_field, points, long_side
        self._tree = build_kd_tree(points.positions, balanced_tree=False, compact_nodes=False)
        self._observations: dict[str, Observation] = {}

    def _camera(self, view: View) -> Camera:
        return view.camera.without_distortion().reduced(self._long_side)

    def observe(self, view: View) -> Observation:
        """Return the surface points that the view's pinhole shows at the working size."""
        if view.name not in self._observations:
            camera = self._camera(view)
            rays = camera_rays(camera, self._field.bounds.device)
            cache = cache_surface(self._field, rays, LABEL_SAMPLES, CACHE_STEP)
            reach = MAX_DISTANCE * self._points.spacing
            _, point = self._tree.query(cache.positions.cpu().numpy(), distance_upper_bound=reach)
            point[point == len(self._points)] = -1
            self._observations[view.name] = Observation((camera.height, camera.width), cache, point)
        return self._observations[view.name]

    def constraints(self, corrections: Sequence[CoarseMask], objects: Sequence[str]) -> Constraints:
        """Return the constraints of the points.

        Args:
            corrections: of any views; may be empty.
            objects: names of the K objects, with all corrected ones.

        Raises:
            DataError: a correction cannot be read.
        """
        n_points, n_classes = len(self._points), len(objects) + 1
        votes, total = np.zeros((n_points, n_classes)), np.zeros(n_points)
        for view in {mark.view.name: mark.view for mark in corrections}.values():
            own = [mark for mark in corrections if mark.view.name == view.name]
            strokes = {objects.index(mark.object_name) + 1: load_correction(mark, self._camera(view)) for mark in own}
            targets, strength = self._votes(self.observe(view), *correction_targets(strokes, n_classes))
            votes += strength[:, None] * targets
            total += strength
        targets = np.where(total[:, None] > 0, votes / np.maximum(total, 1e-12)[:, None], 1 / n_classes)
        return Constraints(targets, total > 0)

    def _votes(self, view: Observation, targets: np.ndarray, corrected: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return targets [p, K+1] and strength [p] of the points, from the pixels of a view."""
        cache, index = view.cache, view.cache.index.cpu().numpy()
        solidity = (torch.exp(-cache.spread / (4 * self._points.spacing)) * cache.opacity).cpu().numpy()
        in_stroke = corrected.ravel()[index]
        # on a thin part all rays of a stroke are silhouette rays: then the more solid half counts
        least = min(MIN_SOLIDITY * np.median(solidity), np.median(solidity[in_stroke])) if in_stroke.any() else 0.0
        strength = in_stroke * (solidity >= least)
        no_point = len(self._points)  # an extra point collects the samples without one
        point = np.where(view.point_of_sample < 0, no_point, view.point_of_sample)
        votes, total = vote_on_points(point, targets.reshape(-1, targets.shape[2])[index], strength, no_point + 1)
        return votes[:-1], total[:-1]
