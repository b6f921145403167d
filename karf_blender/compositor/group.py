"""The node group that recolors a layered picture: one color socket a swatch, and what is linked from the picture.

It computes what the engine does, in display sRGB: base + sum of weight x gains x (color - learned color), clipped, with the
gains of the photo's exposure. Sockets and the picture are scene-linear, as everywhere in the compositor.
"""

from collections.abc import Sequence

import bpy

from ..engine_api import UNIT_GAINS, ObjectLayers
from ..host import compat
from ..nodes.sockets import scene_linear, swatch_socket

DISPLAY = "sRGB"
BASE = "Image"
COLUMN, ROW = 190.0, 200.0  # distances between nodes, in units of the node editor


def fill(tree: bpy.types.NodeTree, objects: Sequence[ObjectLayers]) -> None:
    """Make an empty or older tree the group of these objects, with new sockets."""
    tree.nodes.clear()
    tree.interface.clear()
    _add_sockets(tree, objects)
    source = tree.nodes.new("NodeGroupInput")
    total = _convert(tree, source.outputs[BASE], to_display=True, place=(1, 0))
    swatches = [(each, index) for each in objects for index in range(1, len(each.colors))]
    for number, (each, index) in enumerate(swatches):
        color = source.outputs[swatch_socket(each.name, index)]
        color = _convert(tree, color, to_display=True, place=(1, number + 1))
        change = _math(tree, "SUBTRACT", color, (*map(float, each.colors[index]), 1.0), (2, number + 1))
        if each.gains != UNIT_GAINS:
            change = _math(tree, "MULTIPLY", change, (*each.gains, 1.0), (2.5, number + 1))
        weighted = _math(tree, "MULTIPLY", change, source.outputs[each.weights[index]], (3, number + 1))
        total = _math(tree, "ADD", total, weighted, (4 + number, 0), clips=number == len(swatches) - 1)
    target = tree.nodes.new("NodeGroupOutput")
    target.location = ((6 + len(swatches)) * COLUMN, 0)
    linear = _convert(tree, total, to_display=False, place=(5 + len(swatches), 0))
    tree.links.new(linear, target.inputs[0])


def _add_sockets(tree: bpy.types.NodeTree, objects: Sequence[ObjectLayers]) -> None:
    interface = tree.interface
    interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    for each in objects:
        for index, color in enumerate(each.colors):
            if index:
                name = swatch_socket(each.name, index)
                socket = interface.new_socket(name, in_out="INPUT", socket_type="NodeSocketColor")
                socket.default_value = scene_linear(color)
    panel = interface.new_panel("Layers", default_closed=True)
    interface.new_socket(BASE, in_out="INPUT", socket_type="NodeSocketColor", parent=panel)
    for each in objects:
        for name in each.weights[1:]:
            interface.new_socket(name, in_out="INPUT", socket_type="NodeSocketFloat", parent=panel)


def _convert(tree, color, to_display: bool, place) -> bpy.types.NodeSocket:
    """A color in display sRGB, or back in the scene's linear space, which is what both ends are until one is set."""
    node = _placed(tree.nodes.new("CompositorNodeConvertColorSpace"), place)
    if to_display:
        node.to_color_space = DISPLAY
    else:
        node.from_color_space = DISPLAY
    tree.links.new(color, node.inputs[0])
    return node.outputs[0]


def _math(tree, operation: str, first, second, place, clips: bool = False) -> bpy.types.NodeSocket:
    node = _placed(compat.new_color_math(tree, operation, clips), place)
    *inputs, result = compat.color_math_sockets(node)
    for socket, value in zip(inputs, (first, second), strict=True):
        if isinstance(value, bpy.types.NodeSocket):
            tree.links.new(value, socket)
        else:
            socket.default_value = value
    return result


def _placed(node: bpy.types.Node, place: tuple[float, float]) -> bpy.types.Node:
    node.location = (place[0] * COLUMN, -place[1] * ROW)
    return node
