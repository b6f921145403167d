"""Geometry nodes that recolor the faces of the scene's mesh, with one color socket for each swatch.

They compute the same as the engine, in display sRGB: base + sum of weight x (color - learned color), clipped. Sockets
and stored colors are scene-linear, like all colors in Blender. Only Blender's own nodes are used.
"""

from collections.abc import Sequence

import bpy

from ..engine_api import Palette
from ..nodes.sockets import scene_linear, short, swatch_socket

# attributes of the mesh: of faces the learned sRGB color, center and normal; of corners the displayed color
BASE, CENTER, NORMAL = "base", "center", "normal"
COLOR = "Color"  # Blender's name for a mesh's first color attribute; Cycles shows `color` black
RECOLOR, RADIUS = "Recolor", "Radius"  # names of nodes
COLUMN, ROW = 180.0, 160.0  # distances between nodes, in units of the node editor
# of the piecewise curves of sRGB (IEC 61966-2-1): (threshold, slope below; above: scale x + shift, exponent, gain, lift)
TO_LINEAR = ("KaRF to linear", 0.04045, 1 / 12.92, 1 / 1.055, 0.055 / 1.055, 2.4, 1.0, 0.0)
TO_DISPLAY = ("KaRF to display", 0.0031308, 12.92, 1.0, 0.0, 1 / 2.4, 1.055, -0.055)

Place = tuple[float, float]  # column and row in the node editor


def weight_attribute(name: str, index: int) -> str:
    """Return the name of the attribute with the palette weight of an object's swatch."""
    return f"{probability_attribute(name)}/{index}"


def probability_attribute(name: str) -> str:
    """Return the name of the attribute with an object's probability."""
    return f"karf/{short(name)}"


def fill(tree: bpy.types.NodeTree, palettes: Sequence[Palette]) -> bpy.types.Node:
    """Fill a new or older tree for these palettes, keep its radius, and return the node with the swatches' sockets."""
    old = tree.nodes.get(RADIUS)
    radius = 1.0 if old is None else old.outputs[0].default_value
    tree.nodes.clear()
    if not tree.interface.items_tree:
        tree.is_modifier = True
        for direction in ("INPUT", "OUTPUT"):
            tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    source = _new(tree, "NodeGroupInput", (0, 0))
    sized = _resized(tree, source.outputs[0], radius)
    recolor = _new(tree, "GeometryNodeGroup", (4, 1))
    recolor.name = recolor.label = RECOLOR
    recolor.node_tree, recolor.width = _recoloring(f"{tree.name} colors", palettes), 200
    store = _new(tree, "GeometryNodeStoreNamedAttribute", (6, 0))
    store.data_type, store.domain = "BYTE_COLOR", "CORNER"
    store.inputs["Name"].default_value = COLOR
    tree.links.new(sized, store.inputs["Geometry"])
    tree.links.new(recolor.outputs[0], _enabled(store.inputs, "Value"))
    tree.links.new(store.outputs[0], _new(tree, "NodeGroupOutput", (7, 0)).inputs[0])
    return recolor


def _resized(tree: bpy.types.NodeTree, geometry: bpy.types.NodeSocket, radius: float) -> bpy.types.NodeSocket:
    """Scale faces around their centers; a radius of 1 passes them through, which costs nothing."""
    factor = _new(tree, "ShaderNodeValue", (0, 1))
    factor.name = factor.label = RADIUS
    factor.outputs[0].default_value = radius
    position = _new(tree, "GeometryNodeInputPosition", (0, 2)).outputs[0]
    center = _named(tree, CENTER, "FLOAT_VECTOR", (0, 3))
    arm = _vector(tree, "SUBTRACT", (position, center), (1, 2))
    moved = _new(tree, "GeometryNodeSetPosition", (3, 1))
    tree.links.new(geometry, moved.inputs["Geometry"])
    tree.links.new(_vector(tree, "MULTIPLY_ADD", (arm, factor.outputs[0], center), (2, 2)), moved.inputs["Position"])
    differs = _new(tree, "FunctionNodeCompare", (3, 2))
    differs.data_type, differs.operation = "FLOAT", "NOT_EQUAL"
    differs.inputs["B"].default_value = 1.0
    tree.links.new(factor.outputs[0], differs.inputs["A"])
    choice = _new(tree, "GeometryNodeSwitch", (4, 0))
    choice.input_type = "GEOMETRY"
    for name, value in (("Switch", differs.outputs[0]), ("False", geometry), ("True", moved.outputs[0])):
        tree.links.new(value, _enabled(choice.inputs, name))
    return _enabled(choice.outputs, "Output")


def _recoloring(name: str, palettes: Sequence[Palette]) -> bpy.types.NodeTree:
    """Make the group that computes the color of each face."""
    tree = bpy.data.node_groups.get(name) or bpy.data.node_groups.new(name, "GeometryNodeTree")
    tree.nodes.clear()
    tree.interface.clear()
    tree.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    source, total = _new(tree, "NodeGroupInput", (0, 0)), _named(tree, BASE, "FLOAT_VECTOR", (3, 0))
    swatches = [(each, index) for each in palettes for index in range(1, len(each.colors))]
    for number, (each, index) in enumerate(swatches, 1):
        name = swatch_socket(each.name, index)
        socket = tree.interface.new_socket(name, in_out="INPUT", socket_type="NodeSocketColor")
        socket.default_value = scene_linear(each.colors[index])
        color = _converted(tree, source.outputs[number - 1], TO_DISPLAY, (1, number))
        change = _vector(tree, "SUBTRACT", (color, tuple(map(float, each.colors[index]))), (2, number))
        weight = _named(tree, weight_attribute(each.name, index), "FLOAT", (3, number))
        total = _vector(tree, "MULTIPLY_ADD", (change, weight, total), (3 + number, 0))
    column = 4 + len(swatches)
    total = _vector(tree, "MAXIMUM", (total, (0.0,) * 3), (column, 0))
    total = _vector(tree, "MINIMUM", (total, (1.0,) * 3), (column + 1, 0))
    faces = _new(tree, "GeometryNodeFieldOnDomain", (column + 3, 0))  # one computation for all corners of a face
    faces.domain, faces.data_type = "FACE", "FLOAT_VECTOR"
    tree.links.new(_converted(tree, total, TO_LINEAR, (column + 2, 0)), _enabled(faces.inputs, "Value"))
    target = _new(tree, "NodeGroupOutput", (column + 4, 0))
    tree.links.new(_enabled(faces.outputs, "Value"), target.inputs[0])
    return tree


def _converted(tree, color: bpy.types.NodeSocket, curve: tuple, place: Place) -> bpy.types.NodeSocket:
    node = _new(tree, "GeometryNodeGroup", place)
    node.node_tree = _curve(*curve)
    tree.links.new(color, node.inputs[0])
    return node.outputs[0]


def _curve(name: str, threshold: float, slope: float, *above: float) -> bpy.types.NodeTree:
    """Return the shared group that applies a curve to each channel."""
    tree = bpy.data.node_groups.get(name)
    if tree is not None:
        return tree
    tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Color", in_out=direction, socket_type="NodeSocketVector")
    channels, joined = _new(tree, "ShaderNodeSeparateXYZ", (1, 0)), _new(tree, "ShaderNodeCombineXYZ", (6, 0))
    tree.links.new(_new(tree, "NodeGroupInput", (0, 0)).outputs[0], channels.inputs[0])
    tree.links.new(joined.outputs[0], _new(tree, "NodeGroupOutput", (7, 0)).inputs[0])
    scale, shift, exponent, gain, lift = above
    for row, (value, result) in enumerate(zip(channels.outputs, joined.inputs, strict=True)):
        high = _number(tree, "MULTIPLY_ADD", (value, scale, shift), (2, 3 * row))
        high = _number(tree, "POWER", (high, exponent), (3, 3 * row))
        high = _number(tree, "MULTIPLY_ADD", (high, gain, lift), (4, 3 * row))
        low = _number(tree, "MULTIPLY", (value, slope), (2, 3 * row + 1))
        is_high = _number(tree, "GREATER_THAN", (value, threshold), (2, 3 * row + 2))
        rise = _number(tree, "SUBTRACT", (high, low), (5, 3 * row))
        tree.links.new(_number(tree, "MULTIPLY_ADD", (rise, is_high, low), (5, 3 * row + 1)), result)
    return tree


def _named(tree, name: str, kind: str, place: Place) -> bpy.types.NodeSocket:
    node = _new(tree, "GeometryNodeInputNamedAttribute", place)
    node.data_type = kind
    node.inputs["Name"].default_value = name
    return _enabled(node.outputs, "Attribute")


def _vector(tree, operation: str, values, place: Place) -> bpy.types.NodeSocket:
    return _number(tree, operation, values, place, "ShaderNodeVectorMath")


def _number(tree, operation: str, values, place: Place, kind: str = "ShaderNodeMath") -> bpy.types.NodeSocket:
    node = _new(tree, kind, place)
    node.operation = operation
    for socket, value in zip(node.inputs, values, strict=False):
        if isinstance(value, bpy.types.NodeSocket):
            tree.links.new(value, socket)
        else:
            socket.default_value = value
    return node.outputs[0]


def _enabled(sockets, name: str) -> bpy.types.NodeSocket:
    """Return the enabled socket of a name: some nodes have one for each data type."""
    return next(socket for socket in sockets if socket.name == name and socket.enabled)


def _new(tree, kind: str, place: Place) -> bpy.types.Node:
    node = tree.nodes.new(kind)
    node.location = (place[0] * COLUMN, -place[1] * ROW)
    return node
