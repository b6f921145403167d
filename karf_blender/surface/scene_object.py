"""The learned scene as an object below the rig: small quads that face their normals, in Solid mode, Eevee and Cycles."""

from collections.abc import Iterable, Mapping, Sequence

import bpy
import numpy as np

from ..engine_api import Palette, ScenePoints
from ..nodes.building import shadeless_material
from ..nodes.sockets import remove_drivers, set_colors
from . import trees

NAME = "KaRF scene"
COVER = 0.9  # half a quad's side in distances between points: neighbors overlap and leave no holes
CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float32)


def find(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """Return the object that shows the learned scene, if there is one."""
    item = scene.karf.surface.item
    return item if is_in(scene, item) else None


def is_in(scene: bpy.types.Scene, item: bpy.types.Object | None) -> bool:
    """Return whether the scene has the object that a property names: a deleted one lives on in the property."""
    return item is not None and scene.objects.get(item.name) == item


def build(
    item: bpy.types.Object | None,
    rig: bpy.types.Object,
    points: ScenePoints,
    palettes: Sequence[Palette],
    edited: Mapping[str, np.ndarray],
) -> tuple[bpy.types.Object, bpy.types.Node]:
    """Show points below the rig, and return the object and the node with the swatches' sockets.

    An `item` that showed points before keeps its name, its place and its other modifiers. For `edited`, see `set_colors`.
    """
    data = _mesh(points)
    if item is None:
        item = bpy.data.objects.new(NAME, data)
        item.parent = rig
        for collection in rig.users_collection:
            collection.objects.link(item)
    else:
        old, item.data = item.data, data
        bpy.data.meshes.remove(old)
    data.materials.append(shadeless_material(NAME, trees.COLOR))
    tree = _own_tree(item)
    if (old := tree.nodes.get(trees.RECOLOR)) is not None:
        remove_drivers(old)
    node = trees.fill(tree, palettes)
    set_colors(node, palettes, edited)
    return item, node


def radius_node(item: bpy.types.Object) -> bpy.types.Node | None:
    """Return the node that scales the faces, if there is one."""
    modifier = item.modifiers.get(NAME)
    tree = modifier.node_group if modifier is not None and modifier.type == "NODES" else None
    return tree.nodes.get(trees.RADIUS) if tree is not None else None


def show_colors(spaces: Iterable["bpy.types.SpaceView3D"]) -> None:
    """Let 3D Views show the colors of meshes as they are, in Solid mode."""
    for space in spaces:
        space.shading.type, space.shading.light, space.shading.color_type = "SOLID", "FLAT", "VERTEX"


def _own_tree(item: bpy.types.Object) -> bpy.types.NodeTree:
    """Return the node tree of the object's KaRF modifier, made if missing."""
    modifier = item.modifiers.get(NAME)
    if modifier is None or modifier.type != "NODES":
        modifier = item.modifiers.new(NAME, "NODES")
    if modifier.node_group is None:
        modifier.node_group = bpy.data.node_groups.new(item.name, "GeometryNodeTree")
    return modifier.node_group


# --- the mesh ------------------------------------------------------------------------------------------------------
def _mesh(points: ScenePoints) -> bpy.types.Mesh:
    """Build the mesh in the capture's world."""
    mesh, n = bpy.data.meshes.new(NAME), len(points)
    mesh.vertices.add(4 * n)
    mesh.loops.add(4 * n)
    mesh.polygons.add(n)
    mesh.vertices.foreach_set("co", _corners(points).ravel())
    mesh.loops.foreach_set("vertex_index", np.arange(4 * n, dtype=np.int32))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 4 * n, 4, dtype=np.int32))
    learned = points.colors / np.float32(255)
    _add(mesh, trees.BASE, "FLOAT_VECTOR", learned)
    _add(mesh, trees.CENTER, "FLOAT_VECTOR", points.positions)
    _add(mesh, trees.NORMAL, "FLOAT_VECTOR", points.normals)
    for k, each in enumerate(points.objects):
        _add(mesh, trees.probability_attribute(each), "FLOAT", points.probabilities[:, k])
        for index in range(1, points.palette_weights.shape[2]):
            _add(mesh, trees.weight_attribute(each, index), "FLOAT", points.palette_weights[:, k, index])
    colors = np.ones((n, 4, 4), np.float32)
    colors[..., :3] = learned[:, None]
    mesh.attributes.new(trees.COLOR, "BYTE_COLOR", "CORNER").data.foreach_set("color_srgb", colors.ravel())
    mesh.attributes.active_color = mesh.attributes[trees.COLOR]
    mesh.update(calc_edges=True)
    return mesh


def _corners(points: ScenePoints) -> np.ndarray:
    """Return the corners [N, 4, 3] of quads that face the points' normals."""
    normals = points.normals
    axis = np.eye(3, dtype=np.float32)[np.abs(normals).argmin(1)]  # the farthest from the normal
    right = np.cross(normals, axis)
    right /= np.maximum(np.linalg.norm(right, axis=1, keepdims=True), 1e-12)
    up = np.cross(normals, right)
    half = COVER * points.sizes[:, None, None]
    offsets = half * (CORNERS[:, :1] * right[:, None] + CORNERS[:, 1:] * up[:, None])
    return (points.positions[:, None] + offsets).astype(np.float32)


def _add(mesh: bpy.types.Mesh, name: str, kind: str, values: np.ndarray) -> None:
    data = mesh.attributes.new(name, kind, "FACE").data
    data.foreach_set("vector" if kind == "FLOAT_VECTOR" else "value", values.astype(np.float32).ravel())
