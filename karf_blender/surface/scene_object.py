"""The learned scene as an object below the rig: small quads that face their normals, recolored by geometry nodes.

The nodes compute the same as the engine, in display sRGB: base + sum of weight x (color - learned color), clipped.
Sockets and stored colors are scene-linear, like all colors in Blender. Only Blender's own nodes are used.
"""

from collections.abc import Iterable, Mapping, Sequence

import bpy
import numpy as np

from .. import nodes
from ..engine_api import Palette, ScenePoints
from ..nodes import Place, add, enabled, shadeless_material

NAME = "KaRF scene"
COVER = 0.9  # half a quad's side in distances between points: neighbors overlap and leave no holes
CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float32)
# attributes of the mesh: of faces the learned sRGB color, center and normal; of corners the displayed color
BASE, CENTER, NORMAL = "base", "center", "normal"
COLOR = "Color"  # Blender's name for a mesh's first color attribute; Cycles shows `color` black
RECOLOR, RADIUS = "Recolor", "Radius"  # names of nodes
# of the piecewise curves of sRGB (IEC 61966-2-1): (threshold, slope below; above: scale x + shift, exponent, gain, lift)
TO_LINEAR = ("KaRF to linear", 0.04045, 1 / 12.92, 1 / 1.055, 0.055 / 1.055, 2.4, 1.0, 0.0)
TO_DISPLAY = ("KaRF to display", 0.0031308, 12.92, 1.0, 0.0, 1 / 2.4, 1.055, -0.055)


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
    data.materials.append(shadeless_material(NAME, COLOR))
    tree = _own_tree(item)
    if (old := tree.nodes.get(RECOLOR)) is not None:
        nodes.remove_drivers(old)
    node = _fill(tree, palettes)
    nodes.set_colors(node, palettes, edited)
    return item, node


def radius_node(item: bpy.types.Object) -> bpy.types.Node | None:
    """Return the node that scales the faces, if there is one."""
    modifier = item.modifiers.get(NAME)
    tree = modifier.node_group if modifier is not None and modifier.type == "NODES" else None
    return tree.nodes.get(RADIUS) if tree is not None else None


def show_colors(spaces: Iterable["bpy.types.SpaceView3D"]) -> None:
    """Let 3D Views show the colors of meshes as they are, in Solid mode."""
    for space in spaces:
        space.shading.type, space.shading.light, space.shading.color_type = "SOLID", "FLAT", "VERTEX"


def _own_tree(item: bpy.types.Object) -> bpy.types.NodeTree:
    modifier = item.modifiers.get(NAME)
    if modifier is None or modifier.type != "NODES":
        modifier = item.modifiers.new(NAME, "NODES")
    if modifier.node_group is None:
        modifier.node_group = bpy.data.node_groups.new(item.name, "GeometryNodeTree")
    return modifier.node_group


# --- the mesh ------------------------------------------------------------------------------------------------------
def _mesh(points: ScenePoints) -> bpy.types.Mesh:
    mesh, n = bpy.data.meshes.new(NAME), len(points)
    mesh.vertices.add(4 * n)
    mesh.loops.add(4 * n)
    mesh.polygons.add(n)
    mesh.vertices.foreach_set("co", _corners(points).ravel())
    mesh.loops.foreach_set("vertex_index", np.arange(4 * n, dtype=np.int32))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 4 * n, 4, dtype=np.int32))
    learned = points.colors / np.float32(255)
    _add_attribute(mesh, BASE, "FLOAT_VECTOR", learned)
    _add_attribute(mesh, CENTER, "FLOAT_VECTOR", points.positions)
    _add_attribute(mesh, NORMAL, "FLOAT_VECTOR", points.normals)
    for k, each in enumerate(points.objects):
        _add_attribute(mesh, probability_attribute(each), "FLOAT", points.probabilities[:, k])
        for index in range(1, points.palette_weights.shape[2]):
            _add_attribute(mesh, weight_attribute(each, index), "FLOAT", points.palette_weights[:, k, index])
    colors = np.ones((n, 4, 4), np.float32)
    colors[..., :3] = learned[:, None]
    mesh.attributes.new(COLOR, "BYTE_COLOR", "CORNER").data.foreach_set("color_srgb", colors.ravel())
    mesh.attributes.active_color = mesh.attributes[COLOR]
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


def _add_attribute(mesh: bpy.types.Mesh, name: str, kind: str, values: np.ndarray) -> None:
    data = mesh.attributes.new(name, kind, "FACE").data
    data.foreach_set("vector" if kind == "FLOAT_VECTOR" else "value", values.astype(np.float32).ravel())


# --- the nodes -----------------------------------------------------------------------------------------------------
def weight_attribute(name: str, index: int) -> str:
    """Return the name of the attribute with the palette weight of an object's swatch."""
    return f"{probability_attribute(name)}/{index}"


def probability_attribute(name: str) -> str:
    """Return the name of the attribute with an object's probability."""
    return f"karf/{nodes.short(name)}"


def _fill(tree: bpy.types.NodeTree, palettes: Sequence[Palette]) -> bpy.types.Node:
    """Fill a new or older tree for these palettes, keep its radius, and return the node with the swatches' sockets."""
    old = tree.nodes.get(RADIUS)
    radius = 1.0 if old is None else old.outputs[0].default_value
    tree.nodes.clear()
    if not tree.interface.items_tree:
        tree.is_modifier = True
        for direction in ("INPUT", "OUTPUT"):
            tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    sized = _resized(tree, add(tree, "NodeGroupInput", (0, 0)).outputs[0], radius)
    colors = _recoloring(f"{tree.name} colors", palettes)
    recolor = add(tree, "GeometryNodeGroup", (4, 1), node_tree=colors, name=RECOLOR, label=RECOLOR, width=200)
    kind, inputs = "GeometryNodeStoreNamedAttribute", {"Geometry": sized, "Name": COLOR, "Value": recolor.outputs[0]}
    store = add(tree, kind, (6, 0), inputs, data_type="BYTE_COLOR", domain="CORNER")
    add(tree, "NodeGroupOutput", (7, 0), [store.outputs[0]])
    return recolor


def _resized(tree: bpy.types.NodeTree, geometry: bpy.types.NodeSocket, radius: float) -> bpy.types.NodeSocket:
    """Scale faces around their centers; a radius of 1 passes them through, which costs nothing."""
    value = add(tree, "ShaderNodeValue", (0, 1), name=RADIUS, label=RADIUS).outputs[0]
    value.default_value = radius
    position = add(tree, "GeometryNodeInputPosition", (0, 2)).outputs[0]
    center = _attribute(tree, CENTER, "FLOAT_VECTOR", (0, 3))
    arm = _vector(tree, "SUBTRACT", (position, center), (1, 2))
    scaled = _vector(tree, "MULTIPLY_ADD", (arm, value, center), (2, 2))
    moved = add(tree, "GeometryNodeSetPosition", (3, 1), {"Geometry": geometry, "Position": scaled})
    differs = add(tree, "FunctionNodeCompare", (3, 2), {"A": value, "B": 1.0}, data_type="FLOAT", operation="NOT_EQUAL")
    inputs = {"Switch": differs.outputs[0], "False": geometry, "True": moved.outputs[0]}
    choice = add(tree, "GeometryNodeSwitch", (4, 0), inputs, input_type="GEOMETRY")
    return enabled(choice.outputs, "Output")


def _recoloring(name: str, palettes: Sequence[Palette]) -> bpy.types.NodeTree:
    tree = bpy.data.node_groups.get(name) or bpy.data.node_groups.new(name, "GeometryNodeTree")
    tree.nodes.clear()
    tree.interface.clear()
    tree.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    source, total = add(tree, "NodeGroupInput", (0, 0)), _attribute(tree, BASE, "FLOAT_VECTOR", (3, 0))
    column = 4
    for row, (each, index, name) in enumerate(nodes.swatches_of(palettes), 1):
        socket = tree.interface.new_socket(name, in_out="INPUT", socket_type="NodeSocketColor")
        socket.default_value = nodes.scene_linear(each.colors[index])
        color = _converted(tree, source.outputs[row - 1], TO_DISPLAY, (1, row))
        change = _vector(tree, "SUBTRACT", (color, tuple(map(float, each.colors[index]))), (2, row))
        weight = _attribute(tree, weight_attribute(each.name, index), "FLOAT", (3, row))
        total = _vector(tree, "MULTIPLY_ADD", (change, weight, total), (column, 0))
        column += 1
    total = _vector(tree, "MAXIMUM", (total, (0.0,) * 3), (column, 0))
    total = _vector(tree, "MINIMUM", (total, (1.0,) * 3), (column + 1, 0))
    linear = _converted(tree, total, TO_LINEAR, (column + 2, 0))
    # one computation for all corners of a face
    faces = add(
        tree, "GeometryNodeFieldOnDomain", (column + 3, 0), {"Value": linear}, data_type="FLOAT_VECTOR", domain="FACE"
    )
    add(tree, "NodeGroupOutput", (column + 4, 0), [enabled(faces.outputs, "Value")])
    return tree


def _converted(tree, color: bpy.types.NodeSocket, curve: tuple, place: Place) -> bpy.types.NodeSocket:
    return add(tree, "GeometryNodeGroup", place, [color], node_tree=_curve(*curve)).outputs[0]


def _curve(name: str, threshold: float, slope: float, *above: float) -> bpy.types.NodeTree:
    """Return the shared group that applies a curve to each channel."""
    tree = bpy.data.node_groups.get(name)
    if tree is not None:
        return tree
    tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Color", in_out=direction, socket_type="NodeSocketVector")
    channels = add(tree, "ShaderNodeSeparateXYZ", (1, 0), add(tree, "NodeGroupInput", (0, 0)).outputs)
    scale, shift, exponent, gain, lift = above
    results = []
    for row, value in enumerate(channels.outputs):
        high = _number(tree, "MULTIPLY_ADD", (value, scale, shift), (2, 3 * row))
        high = _number(tree, "POWER", (high, exponent), (3, 3 * row))
        high = _number(tree, "MULTIPLY_ADD", (high, gain, lift), (4, 3 * row))
        low = _number(tree, "MULTIPLY", (value, slope), (2, 3 * row + 1))
        is_high = _number(tree, "GREATER_THAN", (value, threshold), (2, 3 * row + 2))
        rise = _number(tree, "SUBTRACT", (high, low), (5, 3 * row))
        results.append(_number(tree, "MULTIPLY_ADD", (rise, is_high, low), (5, 3 * row + 1)))
    joined = add(tree, "ShaderNodeCombineXYZ", (6, 0), results)
    add(tree, "NodeGroupOutput", (7, 0), joined.outputs)
    return tree


def _attribute(tree, name: str, kind: str, place: Place) -> bpy.types.NodeSocket:
    node = add(tree, "GeometryNodeInputNamedAttribute", place, {"Name": name}, data_type=kind)
    return enabled(node.outputs, "Attribute")


def _vector(tree, operation: str, values, place: Place) -> bpy.types.NodeSocket:
    return add(tree, "ShaderNodeVectorMath", place, values, operation=operation).outputs[0]


def _number(tree, operation: str, values, place: Place) -> bpy.types.NodeSocket:
    return add(tree, "ShaderNodeMath", place, values, operation=operation).outputs[0]
