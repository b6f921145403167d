"""Surface points as a mesh of small quads that face their normals: what Solid mode, Eevee and Cycles all show.

Attributes of its faces: `base` (color as learned, sRGB numbers), `center`, `normal`, `karf/<object>` (probability) and
`karf/<object>/<swatch>` (weight). Colors that are shown are `Color`, of the corners.
"""

import bpy
import numpy as np

from ..engine_api import ScenePoints
from ..nodes.sockets import short

COVER = 0.9  # half a quad's side in distances between points: neighbors overlap and leave no holes
BASE, CENTER, NORMAL = "base", "center", "normal"
COLOR = "Color"  # Blender's name for a mesh's first color attribute; Cycles shows `color` black
CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float32)


def weight_attribute(name: str, index: int) -> str:
    """The attribute with the weight of an object's swatch."""
    return f"{probability_attribute(name)}/{index}"


def probability_attribute(name: str) -> str:
    """The attribute that says how much of a face is an object's."""
    return f"karf/{short(name)}"


def build(name: str, points: ScenePoints) -> bpy.types.Mesh:
    """The mesh of the points, in the capture's world."""
    mesh = bpy.data.meshes.new(name)
    _add_quads(mesh, _corners(points))
    _add(mesh, BASE, "FLOAT_VECTOR", points.colors / np.float32(255))
    _add(mesh, CENTER, "FLOAT_VECTOR", points.positions)
    _add(mesh, NORMAL, "FLOAT_VECTOR", points.normals)
    for k, each in enumerate(points.objects):
        _add(mesh, probability_attribute(each), "FLOAT", points.probabilities[:, k])
        for index in range(1, points.palette_weights.shape[2]):
            _add(mesh, weight_attribute(each, index), "FLOAT", points.palette_weights[:, k, index])
    colors = np.ones((len(points), 4, 4), np.float32)
    colors[..., :3] = (points.colors / np.float32(255))[:, None]
    mesh.attributes.new(COLOR, "BYTE_COLOR", "CORNER").data.foreach_set("color_srgb", colors.ravel())
    mesh.attributes.active_color = mesh.attributes[COLOR]
    mesh.update(calc_edges=True)
    return mesh


def _corners(points: ScenePoints) -> np.ndarray:
    """Corners [N, 4, 3] of quads that face the points' normals."""
    normals = points.normals
    # the world's axis that is farthest from the normal
    axis = np.eye(3, dtype=np.float32)[np.abs(normals).argmin(1)]
    right = np.cross(normals, axis)
    right /= np.maximum(np.linalg.norm(right, axis=1, keepdims=True), 1e-12)
    up = np.cross(normals, right)
    half = COVER * points.sizes[:, None, None]
    return points.positions[:, None] + half * (CORNERS[:, :1] * right[:, None] + CORNERS[:, 1:] * up[:, None])


def _add_quads(mesh: bpy.types.Mesh, corners: np.ndarray) -> None:
    n = len(corners)
    mesh.vertices.add(4 * n)
    mesh.loops.add(4 * n)
    mesh.polygons.add(n)
    mesh.vertices.foreach_set("co", corners.astype(np.float32).ravel())
    mesh.loops.foreach_set("vertex_index", np.arange(4 * n, dtype=np.int32))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 4 * n, 4, dtype=np.int32))


def _add(mesh: bpy.types.Mesh, name: str, kind: str, values: np.ndarray) -> None:
    """Add an attribute of the faces."""
    data = mesh.attributes.new(name, kind, "FACE").data
    data.foreach_set("vector" if kind == "FLOAT_VECTOR" else "value", values.astype(np.float32).ravel())
