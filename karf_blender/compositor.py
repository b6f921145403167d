"""Nodes of the scene's compositor: layers recolored by a group with a socket for each swatch; objects in the scene.

The group computes what the engine does, in display sRGB: base + sum of weight x gains x (color - learned color),
clipped, with the gains of the photo's exposure. Sockets and the picture are scene-linear, like all colors in the
compositor. None of the user's nodes is removed, and no link is replaced.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import bpy
import numpy as np

from . import nodes
from .engine_api import UNIT_GAINS, DataError, ObjectLayers
from .host import compat
from .nodes import Place, add, feed, named, put
from .pictures import images

LINEAR = "Linear Rec.709"  # Blender's name for the space of layers whose space is not named
COMBINED = "Combined"  # Blender's name for the channels R, G and B
DISPLAY = "sRGB"
BASE = "Image"  # the group's socket of the picture
OBJECTS = "KaRF Objects"  # what the scene of the objects is called after, and its render's node
CAPTURED, NEARER = "KaRF Scene", "KaRF Over Scene"


def build(
    scene: bpy.types.Scene,
    path: Path,
    filepath: str,
    objects: Sequence[ObjectLayers],
    edited: Mapping[str, np.ndarray],
    space: str = "",
) -> bpy.types.Node:
    """Recolor the picture of these objects' layers, and return the group's node; nodes of an earlier build are kept.

    `filepath` is the path as the .blend stores it; `edited` are the sRGB colors [M, 3] that sockets begin with by object
    name, else they are the learned ones; `space` is the picture's color space, by default linear Rec. 709. Raises
    DataError if the picture lacks a layer.
    """
    tree, name = compat.compositing_tree(scene), _node_name(path.stem)
    picture = named(tree, f"{name} Layers", "CompositorNodeImage", (-700, 0))
    picture.image = image = bpy.data.images.load(str(path), check_existing=True)
    image.filepath, space = filepath, space or LINEAR
    if images.knows_space(space):
        image.colorspace_settings.name = space
    image.reload()  # it may show an older file
    node = named(tree, name, "CompositorNodeGroup", (-300, 0))
    node.width = 200
    targets = [link.to_socket for link in node.outputs[0].links] if node.outputs else []
    nodes.remove_drivers(node)
    if node.node_tree is None:
        node.node_tree = bpy.data.node_groups.new(name, "CompositorNodeTree")
    fill(node.node_tree, objects)
    for layer, socket in [(COMBINED, BASE), *((name, name) for each in objects for name in each.weights[1:])]:
        if layer not in picture.outputs:
            raise DataError("{path} has no layer {layer!r}.", "Render the layers again.", path=path, layer=layer)
        tree.links.new(picture.outputs[layer], node.inputs[socket])
    nodes.set_colors(node, objects, edited)
    for target in targets or _free_targets(tree, node):
        tree.links.new(node.outputs[0], target)
    return node


def find(scene: bpy.types.Scene, view: str) -> bpy.types.Node | None:
    """Return the group's node of a view, if there is one."""
    return compat.compositing_tree(scene).nodes.get(_node_name(view))


def is_rendered(node: bpy.types.Node) -> bool:
    """Return whether the scene renders the node's output."""
    output = compat.compositing_output(node.id_data)
    return any(link.to_socket == output for link in node.outputs[0].links)


def _node_name(view: str) -> str:
    return f"KaRF {nodes.short(view)}"


def _free_targets(tree: bpy.types.NodeTree, node: bpy.types.Node) -> list[bpy.types.NodeSocket]:
    """Return the inputs of the output and a viewer that are not linked; the viewer is made if missing."""
    viewer = next((each for each in tree.nodes if each.bl_idname == "CompositorNodeViewer"), None)
    if viewer is None:
        viewer = tree.nodes.new("CompositorNodeViewer")
        viewer.location = node.location.x + 300, node.location.y - 150
    return [socket for socket in (compat.compositing_output(tree), viewer.inputs[0]) if not socket.is_linked]


def fill(tree: bpy.types.NodeTree, objects: Sequence[ObjectLayers]) -> None:
    """Make an empty or older tree the group of these objects, with new sockets."""
    tree.nodes.clear()
    tree.interface.clear()
    _add_sockets(tree, objects)
    source = add(tree, "NodeGroupInput", (0, 0))
    total = _convert(tree, source.outputs[BASE], (1, 0), to_color_space=DISPLAY)
    swatches = list(nodes.swatches_of(objects))
    for number, (each, index, socket) in enumerate(swatches, 1):
        color = _convert(tree, source.outputs[socket], (1, number), to_color_space=DISPLAY)
        change = _math(tree, "SUBTRACT", color, (*map(float, each.colors[index]), 1.0), (2, number))
        if each.gains != UNIT_GAINS:
            change = _math(tree, "MULTIPLY", change, (*each.gains, 1.0), (2.5, number))
        weighted = _math(tree, "MULTIPLY", change, source.outputs[each.weights[index]], (3, number))
        total = _math(tree, "ADD", total, weighted, (3 + number, 0), clips=number == len(swatches))
    linear = _convert(tree, total, (5 + len(swatches), 0), from_color_space=DISPLAY)
    add(tree, "NodeGroupOutput", (6 + len(swatches), 0), [linear])


def _add_sockets(tree: bpy.types.NodeTree, objects: Sequence[ObjectLayers]) -> None:
    new = tree.interface.new_socket
    new("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    for each, index, name in nodes.swatches_of(objects):
        socket = new(name, in_out="INPUT", socket_type="NodeSocketColor")
        socket.default_value = nodes.scene_linear(each.colors[index])
    panel = tree.interface.new_panel("Layers", default_closed=True)
    new(BASE, in_out="INPUT", socket_type="NodeSocketColor", parent=panel)
    for each in objects:
        for name in each.weights[1:]:
            new(name, in_out="INPUT", socket_type="NodeSocketFloat", parent=panel)


def _convert(tree: bpy.types.NodeTree, color: bpy.types.NodeSocket, place: Place, **spaces) -> bpy.types.NodeSocket:
    """Convert a color between the two spaces; a space not given is the scene's linear one."""
    return add(tree, "CompositorNodeConvertColorSpace", place, [color], **spaces).outputs[0]


def _math(tree, operation: str, first, second, place: Place, clips: bool = False) -> bpy.types.NodeSocket:
    node = compat.new_color_math(tree, operation, clips)
    put(node, place)
    *inputs, result = compat.color_math_sockets(node)
    feed(inputs[0], first)
    feed(inputs[1], second)
    return result


def build_over_scene(scene: bpy.types.Scene, objects: bpy.types.Scene) -> bpy.types.Node:
    """Show the nearer of the scene and one with transparent film, by new or earlier nodes; return the result's node."""
    tree = compat.compositing_tree(scene)
    front = named(tree, OBJECTS, "CompositorNodeRLayers", (0, 0))
    back = named(tree, CAPTURED, "CompositorNodeRLayers", (0, -450))
    front.scene, back.scene = objects, scene
    node = named(tree, NEARER, "CompositorNodeZcombine", (300, -150))
    compat.set_option(node, "Use Alpha", "use_alpha", True)
    compat.set_option(node, "Anti-Alias", "use_antialias_z", True)
    images = [socket for socket in node.inputs if socket.type == "RGBA"]
    depths = [socket for socket in node.inputs if socket.type == "VALUE"]
    for render, image, depth in zip((front, back), images, depths, strict=True):
        tree.links.new(render.outputs["Image"], image)
        tree.links.new(render.outputs["Depth"], depth)
    output = compat.compositing_output(tree)
    if not output.is_linked or output.links[0].from_node.bl_idname == "CompositorNodeRLayers":
        tree.links.new(node.outputs[0], output)
    return node
