"""Label surface points from the votes of masks, corrections and volumes, by the solver of `segmentation.labels`.

A solver is a function from a `LabelProblem` to a `LabelledSurface`. Add one with `register_labels`, or as an entry
point `karf.labels` that is the function. A `CorrectionSession` keeps labels in memory, so that a stroke corrects them
in a second or two; its masks are rendered from the labelled points, without F_s.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
import torch
from scipy.sparse import csr_matrix

from ..capture.capture import Capture, View
from ..compute.neighbors import build_kd_tree
from ..compute.progress import Emit, Progress
from ..compute.sparse_systems import convergence_as_event
from ..errors import BadRequest, DataError
from ..fields.protocol import Field
from ..heads.fields import Volumes
from ..io.arguments import check_arguments, check_choice
from ..io.plugins import load_plugin, plugin_names
from ..project.settings import LABEL_KINDS, Settings
from ..project.volumes import Volume
from .coarse_masks import CoarseMask
from .corrections import Constraints, ViewObserver, spread
from .label_propagation import has_seeds, neighbor_graph, propagate_labels
from .report import Suggestions, views_to_mark
from .surface_points import Labels, SurfacePoints, surface_points
from .views import RayVotes, cache_views, load_masked_views, vote_on_points, votes_of_rays

LOW_PRECISION = 0.6  # below it, the user is warned


@dataclass(frozen=True)
class LabelledSurface:
    """Labelled surface points. Class k is `objects[k - 1]`, class 0 the background."""

    objects: list[str]
    points: SurfacePoints
    labels: Labels
    fixed: np.ndarray  # [p] bool, the points that corrections fixed

    @property
    def empty_objects(self) -> list[str]:
        return [name for k, name in enumerate(self.objects, 1) if not (self.labels.classes == k).any()]

    def boxes(self, margin: float) -> np.ndarray:
        """Return a box around each object's points, [K, 2, 3] least and greatest corners; an empty one without points.

        margin: added on each side, grid coordinates.
        """
        boxes = {}
        for k in range(1, len(self.objects) + 1):
            own = self.points.positions[self.labels.classes == k]
            if len(own):
                boxes[k] = np.stack([own.min(0) - margin, own.max(0) + margin])
        empty = next(iter(boxes.values()))[[0, 0]]
        return np.stack([boxes.get(k, empty) for k in range(1, len(self.objects) + 1)])

    def near_objects(self, reach: float) -> np.ndarray:
        """Return True for points within about `reach` (grid coordinates) of an object's point, [p]."""
        objects = self.points.positions[self.labels.classes > 0]
        tree = build_kd_tree(objects, balanced_tree=False, compact_nodes=False)
        return np.isfinite(tree.query(self.points.positions, distance_upper_bound=reach)[0])


@dataclass(frozen=True)
class Labelling:
    """The inputs of the label solve, computed once for any number of corrections."""

    points: SurfacePoints
    targets: np.ndarray  # [p, K+1] votes of the masks; rows sum to 1
    confidence: np.ndarray  # [p] >= 0, of the votes
    normals: np.ndarray  # [p, 3] of unit length, outward
    allowed: np.ndarray  # [p, K+1] bool, the classes that volumes allow

    @classmethod
    def of(
        cls,
        scene_field: Field,
        points: SurfacePoints,
        votes: RayVotes,
        objects: Sequence[str],
        volumes: Mapping[str, Sequence[Volume]],
    ) -> Labelling:
        """Collect the inputs from the surface points, the votes of their rays, and volumes by object name."""
        targets, confidence = vote_on_points(
            points.point_of_sample, votes.targets, votes.confidence * votes.opacity, len(points)
        )
        positions = torch.from_numpy(points.positions).float().to(scene_field.bounds.device)
        normals = scene_field.normals(positions).cpu().numpy()
        world = scene_field.space.to_world(positions)
        allowed = Volumes.from_objects(volumes, objects).to(world.device)(world, len(objects)).cpu().numpy()
        allowed = np.concatenate([np.ones((len(points), 1), bool), allowed], 1)
        kept = targets * allowed
        has_votes = kept.sum(1) > 0
        targets = np.where(has_votes[:, None], kept / np.maximum(kept.sum(1, keepdims=True), 1e-12), targets)
        return cls(points, targets, confidence * has_votes, normals, allowed)

    @cached_property
    def graph(self) -> csr_matrix:
        return neighbor_graph(self.points.positions, self.points.lab, self.normals, self.points.spacing)

    def solve(
        self, objects: Sequence[str], constraints: Constraints, rounds: int, random: np.random.Generator
    ) -> Labels:
        """Label the points; corrections are seeds of objects without masks. Raises DataError where no object has any."""
        unmarked = ~np.append(True, has_seeds(self.targets, self.confidence))
        stroked = constraints.fixed & (constraints.targets[:, unmarked].max(1, initial=0) > 0.5)
        targets = np.where(stroked[:, None], constraints.targets, self.targets)
        confidence = np.where(stroked, np.maximum(self.confidence, 1), self.confidence)
        _require_any(objects, has_seeds(targets, confidence))
        points = self.points
        labels = propagate_labels(
            points.positions, points.lab, self.normals, points.spacing, targets, confidence, rounds, random
        )
        return self._within_volumes(labels)

    def _within_volumes(self, labels: Labels) -> Labels:
        if self.allowed.all():
            return labels
        allowed, opinion = ((each + 1e-9) * self.allowed for each in (labels.probabilities, labels.opinion))
        return Labels(
            allowed / allowed.sum(1, keepdims=True), labels.precision, opinion / opinion.sum(1, keepdims=True)
        )

    def corrected(self, labels: Labels, constraints: Constraints) -> Labels:
        """Return labels changed by corrections; see `corrections.spread`."""
        if not constraints.fixed.any():
            return labels
        return self._within_volumes(spread(labels, self.graph, constraints))


@dataclass(frozen=True)
class LabelProblem:
    """The inputs of a label solver."""

    scene_field: Field  # frozen
    objects: list[str]
    points: SurfacePoints
    votes: RayVotes  # of the rays that the points were merged from
    constraints: Constraints  # of the points, from corrections
    volumes: Mapping[str, Sequence[Volume]]  # by object, where it must be inside or outside
    rounds: int  # of an iterative solver, at least 1
    random: np.random.Generator  # the only source of random numbers
    emit: Emit


def label_surface(problem: LabelProblem) -> LabelledSurface:
    """Clean the labels by label propagation. Warns of objects without points, or whose masks contradict their colors.

    Raises DataError where no point belongs to any object.
    """
    objects, points, emit = problem.objects, problem.points, problem.emit
    labelling = Labelling.of(problem.scene_field, points, problem.votes, objects, problem.volumes)
    emit("stage", name="labels", text=f"{len(points)} surface points")
    with convergence_as_event(emit):
        solved = labelling.solve(objects, problem.constraints, problem.rounds, problem.random)
        labels = labelling.corrected(solved, problem.constraints)
    surface = _labelled(objects, points, labels, problem.constraints.fixed, emit)
    for name, precision in zip(objects, labels.precision, strict=True):
        if precision < LOW_PRECISION and name not in surface.empty_objects:
            emit(
                "warning",
                code="precision",
                sentence=f"Only {precision:.0%} of what looks like {name!r} is marked as it: "
                "add a mask from another view, or mark it more tightly.",
            )
    return surface


def vote_on_surface(problem: LabelProblem) -> LabelledSurface:
    """Take the votes of masks as they are, except where corrections contradict them; without votes it is background.

    Raises DataError where no point belongs to any object.
    """
    objects, points, votes, fixed = problem.objects, problem.points, problem.votes, problem.constraints.fixed
    weight = (votes.confidence > 0) * votes.opacity
    targets, confidence = vote_on_points(points.point_of_sample, votes.targets, weight, len(points))
    targets[confidence == 0] = np.eye(votes.targets.shape[1])[0]
    targets[fixed] = problem.constraints.targets[fixed]
    return _labelled(objects, points, Labels(targets, np.ones(len(objects)), targets), fixed, problem.emit)


def _labelled(
    objects: list[str], points: SurfacePoints, labels: Labels, fixed: np.ndarray, emit: Emit
) -> LabelledSurface:
    _require_any(objects, labels.classes > 0)
    surface = LabelledSurface(objects, points, labels, fixed)
    for name in surface.empty_objects:
        sentence = f"Nothing in the scene belongs to {name!r}: mark it more generously, or in another view."
        emit("warning", code="lacking", sentence=sentence)
    return surface


def _require_any(objects: Sequence[str], found: np.ndarray) -> None:
    if not found.any():
        raise DataError(
            "Nothing in the scene belongs to {name!r}.", "Mark it more generously, or in another view.", name=objects[0]
        )


PLUGINS = "karf.labels"
LabelSolver = Callable[[LabelProblem], LabelledSurface]
SOLVERS: dict[str, LabelSolver] = {}


@check_arguments
def register_labels(name: str, solve: LabelSolver) -> None:
    """Add a solver under a name of the setting `segmentation.labels`. Raises BadRequest where another has this name."""
    if SOLVERS.setdefault(name, solve) is not solve:
        raise BadRequest(f"There are other labels {name!r}.", "Choose another name.")
    if name not in LABEL_KINDS:
        LABEL_KINDS.append(name)


def solve_labels(name: str, problem: LabelProblem) -> LabelledSurface:
    """Label the surface with the solver of this name.

    Raises BadRequest for an unknown one, DataError where no point belongs to any object, MissingDependency where the
    plugin with the solver cannot be loaded.
    """
    if name not in SOLVERS and name in plugin_names(PLUGINS):
        register_labels(name, load_plugin(PLUGINS, name))
    check_choice("segmentation.labels", name, tuple(SOLVERS))
    return SOLVERS[name](problem)


register_labels("surface", label_surface)
register_labels("masks", vote_on_surface)
register_labels("votes", vote_on_surface)


class CorrectionSession:
    """Label a scene's surface, correct the labels any number of times, and render masks of any view."""

    def __init__(
        self,
        scene_field: Field,
        capture: Capture,
        masks: Sequence[CoarseMask],
        corrections: Sequence[CoarseMask],
        settings: Settings,
        progress: Progress,  # counts the pixels of the cached views
        volumes: Mapping[str, Sequence[Volume]] = MappingProxyType({}),
    ) -> None:
        """Label the surface. Later corrections may be on other views, but only of the same objects.

        Raises DataError where a mark or a photo cannot be read, or no point belongs to any object.
        """
        own, long_side = settings.segmentation, settings.geometry.long_side
        views = load_masked_views(masks, capture.views, long_side, own, {each.object_name for each in corrections})
        self._cached = cached = cache_views(scene_field, views, own.samples_per_ray, progress)
        points = surface_points(cached, scene_field.voxel)
        self.objects = views.objects  # with those that have only corrections
        self._seen = ViewObserver(scene_field, points, long_side)
        self._labelling = Labelling.of(scene_field, points, votes_of_rays(cached), self.objects, volumes)
        constraints = self._seen.constraints(corrections, self.objects)
        random = np.random.default_rng(settings.seed)
        self._from_masks = self._labelling.solve(self.objects, constraints, own.rounds, random)
        self.labels = self._labelling.corrected(self._from_masks, constraints)

    def correct(self, corrections: Sequence[CoarseMask]) -> None:
        """Update the labels, given all corrections."""
        constraints = self._seen.constraints(corrections, self.objects)
        self.labels = self._labelling.corrected(self._from_masks, constraints)

    def suggestions(self) -> Suggestions:
        """Return the views to mark next."""
        return views_to_mark(self._cached, self._labelling.points, self.labels)

    def masks(self, view: View) -> dict[str, np.ndarray]:
        """Return each object's mask in the view's pinhole at the working size, bool [H, W]."""
        observed, n_classes = self._seen.observe(view), len(self.objects) + 1
        of_points = np.concatenate([self.labels.probabilities, np.eye(n_classes)[:1]])  # index -1 is background
        rays = of_points[observed.point_of_sample].mean(1) * observed.cache.opacity.cpu().numpy()[:, None]
        rays[:, 0] += 1 - rays.sum(1)
        picture = np.zeros(observed.size, int)
        picture.flat[observed.cache.index.cpu().numpy()] = rays.argmax(1)
        return {name: picture == k for k, name in enumerate(self.objects, 1)}
