"""Where objects end in a view's planes, as an artist has moved and faded their edges."""

import dataclasses
from collections.abc import Mapping

import bpy
import numpy as np

from ..engine_api import EdgeShape, KarfError, ObjectEdge, ObjectPlanes, Planes, apply_edges_to_planes, to_mean_exposure
from ..project import captures
from . import colors


class MovableObject:
    """Object k of planes, whose edge can be given any shape, and its part of a picture, which is changed in place."""

    def __init__(self, scene: bpy.types.Scene, planes: Planes, k: int) -> None:
        self._planes, self._k, self._scale = planes, k, scale_of(scene, planes)
        self._known: tuple[str, ObjectEdge, ObjectPlanes] | None = None

    def shaped(self, item: bpy.types.PropertyGroup, shape: EdgeShape) -> tuple[ObjectPlanes, np.ndarray, np.ndarray]:
        """The part with an edge of this shape, its weights spread over the sets of the object's added colors.

        Returns:
            The part, another one where other colors are added; the pixels [n] of it, by running number, in which it has
            changed, and its planes there.
        """
        key = repr(colors.keys(colors.added(item)))
        if self._known is None or self._known[0] != key:
            edge = self._edge(item)
            self._known = key, edge, ObjectPlanes(*((each.start, each.stop) for each in edge.place), edge.weights)
        _, edge, part = self._known
        return part, *edge.shaped(shape)[1:]

    def _edge(self, item: bpy.types.PropertyGroup) -> ObjectEdge:
        """The object as it is learned."""
        planes, k = self._planes, self._k
        probabilities = planes.probabilities.astype(np.float32)
        room = 1 - (probabilities.sum(axis=0) - probabilities[k])
        palette = colors.state(item).palette.colors
        base = to_mean_exposure(planes.base, planes.gains)
        shown = base, planes.palette_weights[k, : len(palette)], probabilities[k]
        return ObjectEdge(*shown, room, palette, self._scale, colors.added(item))


def ended(scene: bpy.types.Scene, planes: Planes, edges: Mapping[str, EdgeShape]) -> Planes:
    """Planes of objects that end where these edges do."""
    palettes = {palette.name: palette for palette in colors.palettes(scene)}
    ordered = [palettes[name] for name in planes.objects]
    shown = to_mean_exposure(planes.base, planes.gains), planes.palette_weights, planes.probabilities
    weights, probabilities = apply_edges_to_planes(*shown, ordered, edges, scale_of(scene, planes))
    return dataclasses.replace(planes, palette_weights=weights, probabilities=probabilities)


def scale_of(scene: bpy.types.Scene, planes: Planes) -> float:
    """Pixels of planes for one of the capture's photos: the ratio of the long sides; 1 where the capture cannot be read."""
    try:
        cameras = [view.camera for view in captures.of(scene).views]
    except KarfError:
        return 1.0
    return max(planes.base.shape[:2]) / float(np.median([max(each.width, each.height) for each in cameras]))
