"""Labels of the surface: which class each point belongs to, from the masks' votes, and where the objects are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from scipy.spatial import cKDTree

from ..errors import DataError
from ..fields.protocol import Field
from ..progress import Emit
from .label_propagation import Labels, has_seeds, propagate_labels
from .surface_points import SurfacePoints
from .votes import RayVotes, vote_on_points

LOW_PRECISION = 0.6


@dataclass(frozen=True)
class LabelledSurface:
    """Surface points and their labels. Class k is `objects[k - 1]`, class 0 the background."""

    objects: list[str]
    points: SurfacePoints
    labels: Labels

    def boxes(self, margin: float) -> np.ndarray:
        """Box round each object's points, [K, 2, 3] grid coordinates: least and greatest corner.

        Each object must have points. margin: room on each side, grid coordinates.
        """
        boxes = []
        for k in range(1, len(self.objects) + 1):
            own = self.points.positions[self.labels.classes == k]
            boxes.append(np.stack([own.min(0) - margin, own.max(0) + margin]))
        return np.stack(boxes)

    def near_objects(self, reach: float) -> np.ndarray:
        """True for points within about `reach` (grid coordinates) of an object's point, [p]."""
        objects = self.points.positions[self.labels.classes > 0]
        tree = cKDTree(objects, balanced_tree=False, compact_nodes=False)
        return np.isfinite(tree.query(self.points.positions, distance_upper_bound=reach)[0])


def label_surface(
    scene_field: Field,
    objects: list[str],
    points: SurfacePoints,
    votes: RayVotes,
    rounds: int,
    random: np.random.Generator,
    emit: Emit,
) -> LabelledSurface:
    """Clean labels by label propagation; warns of objects whose masks contradict their colors.

    Args:
        scene_field: the frozen radiance field; its normals separate what touches.
        objects: names of the K objects.
        points: on the surface.
        votes: of the rays that the points were merged from.
        rounds: of the label propagation, at least 1.
        random: of the label propagation.
        emit: is told the number of points, and of low precision.

    Raises:
        DataError: no point stands for one of the objects.
    """
    targets, confidence = vote_on_points(
        points.point_of_sample, votes.targets, votes.confidence * votes.opacity, len(points)
    )
    _require_all(objects, has_seeds(targets, confidence))
    positions = torch.from_numpy(points.positions).float().to(scene_field.bounds.device)
    normals = scene_field.normals(positions).cpu().numpy()
    emit("stage", name="labels", text=f"{len(points)} surface points")
    labels = propagate_labels(points.positions, points.lab, normals, points.grain, targets, confidence, rounds, random)
    _warn_of_low_precision(objects, labels, emit)
    return _labelled(objects, points, labels)


def vote_on_surface(objects: list[str], points: SurfacePoints, votes: RayVotes) -> LabelledSurface:
    """The masks' votes as they are: the ceiling of what labels can be, where the masks are exact.

    Points without a vote are background. Arguments as for `label_surface`.

    Raises:
        DataError: no point belongs to one of the objects.
    """
    weight = (votes.confidence > 0) * votes.opacity
    targets, confidence = vote_on_points(points.point_of_sample, votes.targets, weight, len(points))
    targets[confidence == 0] = np.eye(votes.targets.shape[1])[0]
    return _labelled(objects, points, Labels(targets, np.ones(len(objects))))


def _labelled(objects: list[str], points: SurfacePoints, labels: Labels) -> LabelledSurface:
    classes = labels.classes
    _require_all(objects, [(classes == number).any() for number in range(1, len(objects) + 1)])
    return LabelledSurface(objects, points, labels)


def _require_all(objects: list[str], is_there: Sequence[bool]) -> None:
    for name, found in zip(objects, is_there, strict=True):
        if not found:
            raise DataError(
                f"Nothing in the scene belongs to {name!r}.", "Mark it more generously, or in another view."
            )


def _warn_of_low_precision(objects: list[str], labels: Labels, emit: Emit) -> None:
    for name, precision in zip(objects, labels.precision, strict=True):
        if precision < LOW_PRECISION:
            emit(
                "warning",
                code="precision",
                sentence=f"Only {precision:.0%} of what looks like {name!r} is marked as it: "
                "add a mask from another view, or mark it more tightly.",
            )
