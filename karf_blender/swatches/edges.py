"""Where objects end in a view's planes, as an artist has moved and faded their edges."""

import dataclasses
from collections.abc import Mapping

import bpy
import numpy as np

from ..engine_api import EdgeShape, KarfError, ObjectEdge, Part, Planes, reshaped, spread
from ..project import captures
from . import colors


class MovableObject:
    """Object k of planes, whose edge can be given any shape, and its part of a picture, which is changed in place."""

    def __init__(self, scene: bpy.types.Scene, planes: Planes, k: int) -> None:
        probabilities = planes.probabilities.astype(np.float32)
        room = 1 - (probabilities.sum(axis=0) - probabilities[k])
        palette = colors.palette(scene.karf.objects[planes.objects[k]]).colors
        weights = planes.palette_weights[k, : len(palette)]
        self._edge = ObjectEdge(planes.base, weights, probabilities[k], room, palette, scale_of(scene, planes))
        self._part: tuple[str, Part] | None = None

    def shaped(self, item: bpy.types.PropertyGroup, shape: EdgeShape) -> tuple[Part, np.ndarray, np.ndarray]:
        """The part with an edge of this shape, its weights spread over the sets of the object's added colors.

        Returns:
            The part, another one where other colors are added; and rows and columns [n] of the picture's pixels in which it
            has changed.
        """
        weights, _, pixels = self._edge.shaped(shape)
        palette, added, place = colors.palette(item).colors, colors.added(item), self._edge.place
        rows, columns = np.divmod(pixels, place[1].stop - place[1].start)
        key = repr(colors.keys(added))
        if self._part is None or self._part[0] != key:
            ends = ((each.start, each.stop) for each in place)
            self._part = key, Part(*ends, spread(weights, palette, added))
        elif added:
            changed = spread(np.take(weights.reshape(len(weights), -1), pixels, axis=1), palette, added)
            for plane, values in zip(self._part[1].planes, changed, strict=True):
                plane.reshape(-1)[pixels] = values
        return self._part[1], rows + place[0].start, columns + place[1].start


def ended(scene: bpy.types.Scene, planes: Planes, edges: Mapping[str, EdgeShape]) -> Planes:
    """Planes of objects that end where these edges do."""
    palettes = {palette.name: palette for palette in colors.palettes(scene)}
    ordered = [palettes[name] for name in planes.objects]
    shown = planes.base, planes.palette_weights, planes.probabilities
    weights, probabilities = reshaped(*shown, ordered, edges, scale_of(scene, planes))
    return dataclasses.replace(planes, palette_weights=weights, probabilities=probabilities)


def scale_of(scene: bpy.types.Scene, planes: Planes) -> float:
    """Pixels of planes for one of the capture's photos: the ratio of the long sides; 1 where the capture cannot be read."""
    try:
        cameras = [view.camera for view in captures.of(scene).views]
    except KarfError:
        return 1.0
    return max(planes.base.shape[:2]) / float(np.median([max(each.width, each.height) for each in cameras]))
