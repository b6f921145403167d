"""Geometry nodes that recolor the faces of a scene's mesh, of Blender's own nodes alone: one color socket a swatch.

They compute what the engine does, in display sRGB: base + sum of weight x (color - learned color), clipped. Sockets and
what is stored are scene-linear, as all colors of Blender. What is the same for a face is computed once for it.
"""

from collections.abc import Sequence

import bpy

from ..engine_api import Palette
from ..nodes.sockets import scene_linear, swatch_socket
from . import mesh

RECOLOR, RADIUS = "Recolor", "Radius"  # names of nodes
COLUMN, ROW = 180.0, 160.0  # distances between nodes, in units of the node editor
# of the piecewise curves of sRGB (IEC 61966-2-1): (threshold, slope below; above: scale x + shift, exponent, gain, lift)
TO_LINEAR = ("KaRF to linear", 0.04045, 1 / 12.92, 1 / 1.055, 0.055 / 1.055, 2.4, 1.0, 0.0)
TO_DISPLAY = ("KaRF to display", 0.0031308, 12.92, 1.0, 0.0, 1 / 2.4, 1.055, -0.055)


def fill(tree: bpy.types.NodeTree, palettes: Sequence[Palette]) -> bpy.types.Node:
    """Make an empty or older tree the one that shows these objects; what its radius was it stays.

    Returns:
        The node with the swatches' sockets.
    """
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
    store.inputs["Name"].default_value = mesh.COLOR
    tree.links.new(sized, store.inputs["Geometry"])
    tree.links.new(recolor.outputs[0], _enabled(store.inputs, "Value"))
    tree.links.new(store.outputs[0], _new(tree, "NodeGroupOutput", (7, 0)).inputs[0])
    return recolor


def _resized(tree: bpy.types.NodeTree, geometry: bpy.types.NodeSocket, radius: float) -> bpy.types.NodeSocket:
    """The faces scaled round their centers; at 1, which costs nothing, as they are."""
    factor = _new(tree, "ShaderNodeValue", (0, 1))
    factor.name = factor.label = RADIUS
    factor.outputs[0].default_value = radius
    position, center = (
        _new(tree, "GeometryNodeInputPosition", (0, 2)),
        _named(tree, mesh.CENTER, "FLOAT_VECTOR", (0, 3)),
    )
    arm = _vector(tree, "SUBTRACT", (position.outputs[0], center), (1, 2))
    placed = _vector(tree, "MULTIPLY_ADD", (arm, factor.outputs[0], center), (2, 2))
    moved = _new(tree, "GeometryNodeSetPosition", (3, 1))
    tree.links.new(geometry, moved.inputs["Geometry"])
    tree.links.new(placed, moved.inputs["Position"])
    differs = _new(tree, "FunctionNodeCompare", (3, 2))
    differs.data_type, differs.operation = "FLOAT", "NOT_EQUAL"
    differs.inputs["B"].default_value = 1.0
    tree.links.new(factor.outputs[0], differs.inputs["A"])
    choice = _new(tree, "GeometryNodeSwitch", (4, 0))
    choice.input_type = "GEOMETRY"
    tree.links.new(differs.outputs[0], _enabled(choice.inputs, "Switch"))
    tree.links.new(geometry, _enabled(choice.inputs, "False"))
    tree.links.new(moved.outputs[0], _enabled(choice.inputs, "True"))
    return _enabled(choice.outputs, "Output")


def _recoloring(name: str, palettes: Sequence[Palette]) -> bpy.types.NodeTree:
    """The group that gives each face its color."""
    tree = bpy.data.node_groups.get(name) or bpy.data.node_groups.new(name, "GeometryNodeTree")
    tree.nodes.clear()
    tree.interface.clear()
    tree.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    swatches = [(each, index) for each in palettes for index in range(1, len(each.colors))]
    for each, index in swatches:
        socket = tree.interface.new_socket(
            swatch_socket(each.name, index), in_out="INPUT", socket_type="NodeSocketColor"
        )
        socket.default_value = scene_linear(each.colors[index])
    source, total = _new(tree, "NodeGroupInput", (0, 0)), _named(tree, mesh.BASE, "FLOAT_VECTOR", (3, 0))
    for number, (each, index) in enumerate(swatches, 1):
        shown = _converted(tree, source.outputs[number - 1], TO_DISPLAY, (1, number))
        change = _vector(tree, "SUBTRACT", (shown, tuple(map(float, each.colors[index]))), (2, number))
        weight = _named(tree, mesh.weight_attribute(each.name, index), "FLOAT", (3, number))
        total = _vector(tree, "MULTIPLY_ADD", (change, weight, total), (3 + number, 0))
    total = _vector(tree, "MAXIMUM", (total, (0.0,) * 3), (4 + len(swatches), 0))
    total = _vector(tree, "MINIMUM", (total, (1.0,) * 3), (5 + len(swatches), 0))
    linear = _converted(tree, total, TO_LINEAR, (6 + len(swatches), 0))
    faces = _new(tree, "GeometryNodeFieldOnDomain", (7 + len(swatches), 0))
    faces.domain, faces.data_type = "FACE", "FLOAT_VECTOR"
    tree.links.new(linear, _enabled(faces.inputs, "Value"))
    target = _new(tree, "NodeGroupOutput", (8 + len(swatches), 0))
    tree.links.new(_enabled(faces.outputs, "Value"), target.inputs[0])
    return tree


def _converted(tree, color: bpy.types.NodeSocket, curve: tuple, place) -> bpy.types.NodeSocket:
    node = _new(tree, "GeometryNodeGroup", place)
    node.node_tree = _curve(*curve)
    tree.links.new(color, node.inputs[0])
    return node.outputs[0]


def _curve(name: str, threshold: float, slope: float, *above: float) -> bpy.types.NodeTree:
    """A group that applies a curve to each channel; all that need it share it."""
    tree = bpy.data.node_groups.get(name)
    if tree is not None:
        return tree
    tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Color", in_out=direction, socket_type="NodeSocketVector")
    apart, joined = _new(tree, "ShaderNodeSeparateXYZ", (1, 0)), _new(tree, "ShaderNodeCombineXYZ", (6, 0))
    tree.links.new(_new(tree, "NodeGroupInput", (0, 0)).outputs[0], apart.inputs[0])
    tree.links.new(joined.outputs[0], _new(tree, "NodeGroupOutput", (7, 0)).inputs[0])
    scale, shift, exponent, gain, lift = above
    for row, (value, result) in enumerate(zip(apart.outputs, joined.inputs, strict=True)):
        high = _number(tree, "MULTIPLY_ADD", (value, scale, shift), (2, 3 * row))
        high = _number(tree, "POWER", (high, exponent), (3, 3 * row))
        high = _number(tree, "MULTIPLY_ADD", (high, gain, lift), (4, 3 * row))
        low = _number(tree, "MULTIPLY", (value, slope), (2, 3 * row + 1))
        is_high = _number(tree, "GREATER_THAN", (value, threshold), (2, 3 * row + 2))
        rise = _number(tree, "SUBTRACT", (high, low), (5, 3 * row))
        tree.links.new(_number(tree, "MULTIPLY_ADD", (rise, is_high, low), (5, 3 * row + 1)), result)
    return tree


def _named(tree, name: str, kind: str, place) -> bpy.types.NodeSocket:
    node = _new(tree, "GeometryNodeInputNamedAttribute", place)
    node.data_type = kind
    node.inputs["Name"].default_value = name
    return _enabled(node.outputs, "Attribute")


def _vector(tree, operation: str, values, place) -> bpy.types.NodeSocket:
    return _computed(tree, "ShaderNodeVectorMath", operation, values, place)


def _number(tree, operation: str, values, place) -> bpy.types.NodeSocket:
    return _computed(tree, "ShaderNodeMath", operation, values, place)


def _computed(tree, kind: str, operation: str, values, place) -> bpy.types.NodeSocket:
    node = _new(tree, kind, place)
    node.operation = operation
    for socket, value in zip(node.inputs, values, strict=False):
        if isinstance(value, bpy.types.NodeSocket):
            tree.links.new(value, socket)
        else:
            socket.default_value = value
    return node.outputs[0]


def _enabled(sockets, name: str) -> bpy.types.NodeSocket:
    """The socket of a node by this name: some nodes have one for each type, of which one is at work."""
    return next(socket for socket in sockets if socket.name == name and socket.enabled)


def _new(tree, kind: str, place: tuple[int, int]) -> bpy.types.Node:
    node = tree.nodes.new(kind)
    node.location = (place[0] * COLUMN, -place[1] * ROW)
    return node
