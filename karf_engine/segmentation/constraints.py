"""The classes that corrections allow surface points to have, regardless of masks and colors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch

from ..capture.camera import Camera
from ..capture.capture import View
from ..compute.neighbors import tree_of
from ..fields.protocol import Field
from ..fields.rendering.rays import camera_rays
from ..fields.rendering.surface_cache import SurfaceCache, cache_surface
from .coarse_masks import CoarseMask
from .corrections import IS, IS_NOT, load_correction
from .surface_points import LABEL_SAMPLES, SurfacePoints
from .views import CACHE_STEP
from .votes import vote_on_points

REACH = 4.0  # point spacings, within which a sample belongs to a point
LEAST_SOLID = 0.5  # of a ray that fixes points, of the view's median: a silhouette's samples lie far apart


@dataclass(frozen=True)
class Constraints:
    """The classes that corrections require or forbid for p surface points.

    Attributes:
        targets: [p, K+1] shares of the classes; rows sum to 1; only classes with a share are allowed.
        fixed: [p] bool, the points that are constrained.
    """

    targets: np.ndarray
    fixed: np.ndarray


def correction_targets(said: Mapping[int, np.ndarray], n_classes: int) -> tuple[np.ndarray, np.ndarray]:
    """Which classes the corrected pixels of one view may have.

    Args:
        said: {class number: int8 [H, W]}, at least one.
        n_classes: K + 1, background included.

    Returns:
        Shares of the classes [H, W, n_classes], whose sums are 1, and where a correction is, bool [H, W].
    """
    shape = next(iter(said.values())).shape
    is_it, allowed = np.zeros((*shape, n_classes)), np.ones((*shape, n_classes))
    for number, picture in said.items():
        is_it[..., number] = picture == IS
        allowed[..., number] = picture != IS_NOT
    targets = np.where(is_it.any(2, keepdims=True), is_it, allowed)
    return targets / targets.sum(2, keepdims=True), np.logical_or.reduce([picture != 0 for picture in said.values()])


@dataclass(frozen=True)
class Look:
    """What a view's rays hit. size: height, width. cache: of n rays. point_of_sample: [n, S], -1 where there is none."""

    size: tuple[int, int]
    cache: SurfaceCache
    point_of_sample: np.ndarray


class SeenPoints:
    """Which surface points the rays of single views hit; every view is looked at once."""

    def __init__(self, scene_field: Field, points: SurfacePoints, long_side: int) -> None:
        """scene_field: frozen. long_side: the working size, pixels."""
        self._field, self._points, self._long_side = scene_field, points, long_side
        self._tree = tree_of(points.positions, balanced_tree=False, compact_nodes=False)
        self._looks: dict[str, Look] = {}

    def camera(self, view: View) -> Camera:
        """The view's pinhole at the working size."""
        return view.camera.without_distortion().reduced(self._long_side)

    def look(self, view: View) -> Look:
        """What the rays of the view's pinhole hit."""
        if view.name not in self._looks:
            camera = self.camera(view)
            rays = camera_rays(camera, self._field.bounds.device)
            cache = cache_surface(self._field, rays, LABEL_SAMPLES, CACHE_STEP)
            _, point = self._tree.query(
                cache.positions.cpu().numpy(), distance_upper_bound=REACH * self._points.spacing
            )
            point[point == len(self._points)] = -1
            self._looks[view.name] = Look((camera.height, camera.width), cache, point)
        return self._looks[view.name]

    def constraints(self, corrections: Sequence[CoarseMask], objects: Sequence[str]) -> Constraints:
        """The constraints of the points. A ray whose samples lie far apart, at a silhouette, constrains each little.

        Args:
            corrections: of any views; none is fine.
            objects: names of the K objects, all that are corrected among them.

        Raises:
            DataError: a correction cannot be read.
        """
        n_points, n_classes = len(self._points), len(objects) + 1
        votes, total = np.zeros((n_points, n_classes)), np.zeros(n_points)
        for view in {mark.view.name: mark.view for mark in corrections}.values():
            own = [mark for mark in corrections if mark.view.name == view.name]
            said = {objects.index(mark.object_name) + 1: load_correction(mark, self.camera(view)) for mark in own}
            view_targets, view_strength = self._votes(self.look(view), *correction_targets(said, n_classes))
            votes += view_strength[:, None] * view_targets
            total += view_strength
        even = 1 / n_classes
        targets = np.where(total[:, None] > 0, votes / np.maximum(total, 1e-12)[:, None], even)
        return Constraints(targets, total > 0)

    def _votes(self, look: Look, targets: np.ndarray, said: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Targets [p, K+1] and strength [p] of the points, from the constraints of a view's pixels."""
        cache, index = look.cache, look.cache.index.cpu().numpy()
        solid = (torch.exp(-cache.spread / (4 * self._points.spacing)) * cache.opacity).cpu().numpy()
        asked = said.ravel()[index]
        # of a stroke on what is thin all rays are like that, and the better half of them counts
        least = min(LEAST_SOLID * np.median(solid), np.median(solid[asked])) if asked.any() else 0.0
        strength = asked * (solid >= least)
        nowhere = len(self._points)  # one point more, which takes the samples that hit none
        point = np.where(look.point_of_sample < 0, nowhere, look.point_of_sample)
        found, total = vote_on_points(point, targets.reshape(-1, targets.shape[2])[index], strength, nowhere + 1)
        return found[:-1], total[:-1]
