"""Geometry nodes that recolor the faces of the scene's mesh, with one color socket for each swatch.

They compute the same as the engine, in display sRGB: base + sum of weight x (color - learned color), clipped. Sockets
and stored colors are scene-linear, like all colors in Blender. Only Blender's own nodes are used.
"""

from collections.abc import Sequence

import bpy

from ..engine_api import Palette
from ..nodes.building import Place, add, enabled
from ..nodes.sockets import scene_linear, short, swatches_of

# attributes of the mesh: of faces the learned sRGB color, center and normal; of corners the displayed color
BASE, CENTER, NORMAL = "base", "center", "normal"
COLOR = "Color"  # Blender's name for a mesh's first color attribute; Cycles shows `color` black
RECOLOR, RADIUS = "Recolor", "Radius"  # names of nodes
# of the piecewise curves of sRGB (IEC 61966-2-1): (threshold, slope below; above: scale x + shift, exponent, gain, lift)
TO_LINEAR = ("KaRF to linear", 0.04045, 1 / 12.92, 1 / 1.055, 0.055 / 1.055, 2.4, 1.0, 0.0)
TO_DISPLAY = ("KaRF to display", 0.0031308, 12.92, 1.0, 0.0, 1 / 2.4, 1.055, -0.055)


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
    """Make the group that computes the color of each face."""
    tree = bpy.data.node_groups.get(name) or bpy.data.node_groups.new(name, "GeometryNodeTree")
    tree.nodes.clear()
    tree.interface.clear()
    tree.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    source, total = add(tree, "NodeGroupInput", (0, 0)), _attribute(tree, BASE, "FLOAT_VECTOR", (3, 0))
    column = 4
    for row, (each, index, name) in enumerate(swatches_of(palettes), 1):
        socket = tree.interface.new_socket(name, in_out="INPUT", socket_type="NodeSocketColor")
        socket.default_value = scene_linear(each.colors[index])
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
