"""Corrections: strokes that mark some pixels of a photo as an object or not, and what follows for the surface.

CORRECTIONS/<object>/<view>.png, as large as the photo, 8-bit gray with alpha: opaque white is the object, opaque black
is not, transparent pixels are open. Any view may have them. Colors may overrule a mask, but never a correction.

A stroke fixes the surface points that its rays hit, and unsure points tied to them follow. A linear system on the
neighbor graph gives the change d of the labels x; each point resists by its margin:

    (D + C) d - lambda W d = C (y - x)      C: CORRECTED at corrections, else LEAST_HELD + HELD * margin ** POWER

The right-hand side is 0 except where a correction y contradicts the labels. Wrong labels mostly have small margins, so
a change runs through such a patch and stops where labels are sure.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from scipy import sparse

from ..capture.camera import Camera
from ..capture.capture import Capture, View
from ..compute.neighbors import build_kd_tree
from ..errors import DataError
from ..fields.protocol import Field
from ..fields.rendering.rays import camera_rays
from ..fields.rendering.surface_cache import SurfaceCache, cache_surface
from ..io.images import read_pixels, white_level
from .coarse_masks import CoarseMask, masks_of_object, object_folders, to_working_size
from .label_propagation import SMOOTHNESS, conjugate_gradients
from .surface_points import LABEL_SAMPLES, Labels, SurfacePoints
from .views import CACHE_STEP, vote_on_points

OBJECT, NOT_OBJECT = 1, -1
MIN_COVERAGE = 0.25  # of a pixel by a stroke: thin strokes must survive the reduction of the photo
MAX_DISTANCE = 4.0  # point spacings from a sample to its point
MIN_SOLIDITY = 0.5  # of a ray that constrains points, relative to the view's median: silhouette rays are below
CORRECTED = 1000.0  # confidence of corrections, far above what all neighbors weigh
HELD, LEAST_HELD = 30.0, 0.02  # confidence of labels without a doubt, and in full doubt
POWER = 10.0  # of the margin


def find_corrections(folder: Path, capture: Capture) -> list[CoarseMask]:
    """Return the corrections below a folder, by object and view; none where the folder is missing.

    Raises DataError as `find_masks` does, except that folders may be empty.
    """
    folders = object_folders(folder) if folder.is_dir() else []
    return [each for path in folders for each in masks_of_object(path, capture)]


def load_correction(correction: CoarseMask, camera: Camera) -> np.ndarray:
    """Return `OBJECT`, `NOT_OBJECT` or 0 (open) for each pixel of a view's pinhole, [H, W] int8.

    Raises DataError where the file has no alpha, is damaged, or as large as neither the photo nor the camera's picture.
    """
    pixels, _ = read_pixels(correction.path, True)
    if pixels.ndim != 3 or pixels.shape[2] not in (2, 4):
        raise DataError(f"{correction.path} has no alpha: it says something of every pixel.", "Save gray with alpha.")
    half = white_level(pixels) / 2
    opaque, white = pixels[..., -1] > half, pixels[..., 0] > half
    positive, negative = (to_working_size(opaque & kind, correction, camera) for kind in (white, ~white))
    strokes = np.where(positive >= negative, OBJECT, NOT_OBJECT)
    return np.where(np.maximum(positive, negative) >= MIN_COVERAGE, strokes, 0).astype(np.int8)


@dataclass(frozen=True)
class Constraints:
    """The classes that corrections require or forbid for p surface points."""

    targets: np.ndarray  # [p, K+1] shares of the allowed classes; rows sum to 1
    fixed: np.ndarray  # [p] bool, the constrained points


def correction_targets(strokes: Mapping[int, np.ndarray], n_classes: int) -> tuple[np.ndarray, np.ndarray]:
    """Return shares of the classes that one view's strokes leave, [H, W, n_classes], and the corrected pixels [H, W].

    strokes: {class number: int8 [H, W]}, at least one. n_classes: K + 1.
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
    """The surface points that one view shows."""

    size: tuple[int, int]  # height and width
    cache: SurfaceCache  # of the view's n rays
    point_of_sample: np.ndarray  # [n, S], -1 where no point is near


class ViewObserver:
    """Find the surface points that single views show; each view is traced once."""

    def __init__(self, scene_field: Field, points: SurfacePoints, long_side: int) -> None:
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
        """Return the constraints of the points by corrections of any views, of these objects."""
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


def spread(labels: Labels, graph: sparse.csr_matrix, constraints: Constraints) -> Labels:
    """Return the labels changed by corrections. A stroke that agrees with the labels changes no other point."""
    x, fixed = labels.probabilities, constraints.fixed
    # if a stroke only excludes classes, the labels so far decide among the others
    wanted = constraints.targets * np.where(constraints.targets.max(1, keepdims=True) > 0.5, 1, x + 1e-3)
    wanted /= wanted.sum(1, keepdims=True)
    contradicted = fixed & (constraints.targets[np.arange(len(x)), labels.classes] == 0)
    confidence = np.where(fixed, CORRECTED, LEAST_HELD + HELD * labels.margin**POWER)
    diagonal = (SMOOTHNESS * np.asarray(graph.sum(1)).ravel() + confidence)[:, None]
    right = CORRECTED * contradicted[:, None] * (wanted - x)
    change = conjugate_gradients(
        lambda d: diagonal * d - SMOOTHNESS * (graph @ d), diagonal[:, 0], right, np.zeros_like(x)
    )
    solved, opinion = (
        np.where(fixed[:, None], wanted, np.clip(each + change, 0, None) + 1e-9) for each in (x, labels.opinion)
    )
    return Labels(solved / solved.sum(1, keepdims=True), labels.precision, opinion / opinion.sum(1, keepdims=True))
