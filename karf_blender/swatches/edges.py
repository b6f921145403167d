"""Where objects end in a view's planes, as an artist has moved and faded their edges."""

import dataclasses
from collections.abc import Mapping

import bpy
import numpy as np

from ..engine_api import EdgeShape, KarfError, ObjectEdge, Part, Planes, reshaped, spread
from ..project import captures
from . import colors


def movable(scene: bpy.types.Scene, planes: Planes, k: int) -> ObjectEdge:
    """Object k of planes, whose edge can be given any shape."""
    probabilities = planes.probabilities.astype(np.float32)
    room = 1 - (probabilities.sum(axis=0) - probabilities[k])
    palette = colors.palette(scene.karf.objects[planes.objects[k]]).colors
    weights = planes.palette_weights[k, : len(palette)]
    return ObjectEdge(planes.base, weights, probabilities[k], room, palette, scale_of(scene, planes))


def part_of(item: bpy.types.PropertyGroup, own: ObjectEdge, shape: EdgeShape) -> Part:
    """An object with an edge of this shape, its weights spread over the sets of its added colors."""
    (rows, columns), weights, _ = own.shaped(shape)
    weights = spread(weights, colors.palette(item).colors, colors.added(item))
    return Part((rows.start, rows.stop), (columns.start, columns.stop), weights)


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
