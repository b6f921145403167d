"""The group in the scene's compositor: a layered picture's node, the group's, and what they are linked to.

Of the user's nodes none is removed, and no link is replaced.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import bpy
import numpy as np

from ..engine_api import DataError, ObjectLayers
from ..host import compat
from ..nodes import drivers, sockets
from ..pictures import images
from . import group

LINEAR = "Linear Rec.709"  # what Blender calls the space of layers whose space is not named
COMBINED = "Combined"  # Blender's name for the channels R, G and B


def build(
    scene: bpy.types.Scene,
    path: Path,
    filepath: str,
    objects: Sequence[ObjectLayers],
    edited: Mapping[str, np.ndarray],
    space: str = "",
) -> bpy.types.Node:
    """Recolor a layered picture in the scene's compositor; built anew, its nodes are the same ones with new values.

    Args:
        scene: The scene.
        path: The picture.
        filepath: The same as the .blend stores it.
        objects: Its layers.
        edited: Palettes [M, 3] that sockets begin with, by the object's name; others begin as learned.
        space: Color space of the picture, where Blender knows it; empty: linear Rec. 709.

    Returns:
        The group's node.

    Raises:
        DataError: The picture has not the layers that its header names.
    """
    tree, name = compat.compositing_tree(scene), node_name(path.stem)
    picture = _node(tree, f"{name} Layers", "CompositorNodeImage", (-700, 0))
    picture.image = _load(path, filepath, space)
    node = _node(tree, name, "CompositorNodeGroup", (-300, 0))
    node.width = 200
    targets = [link.to_socket for link in node.outputs[0].links] if node.outputs else []
    drivers.remove(node)
    if node.node_tree is None:
        node.node_tree = bpy.data.node_groups.new(name, "CompositorNodeTree")
    group.fill(node.node_tree, objects)
    _link_layers(tree, picture, node, objects, path)
    for each in objects:
        colors = edited.get(each.name, each.colors)
        for index in range(1, len(each.colors)):
            node.inputs[sockets.swatch_socket(each.name, index)].default_value = sockets.scene_linear(colors[index])
    for target in targets or _free_targets(tree, node):
        tree.links.new(node.outputs[0], target)
    return node


def node_name(view: str) -> str:
    """What the group's node of a view is called."""
    return f"KaRF {sockets.short(view)}"


def find(scene: bpy.types.Scene, view: str) -> bpy.types.Node | None:
    """The group's node of a view, if there is one."""
    return compat.compositing_tree(scene).nodes.get(node_name(view))


def _node(tree: bpy.types.NodeTree, name: str, kind: str, location: tuple[float, float]) -> bpy.types.Node:
    """The node by this name, made where there is none of this kind."""
    node = tree.nodes.get(name)
    if node is None or node.bl_idname != kind:
        node = tree.nodes.new(kind)
        node.name = node.label = name
        node.location = location
    return node


def _load(path: Path, filepath: str, space: str) -> bpy.types.Image:
    """The picture as the disk has it now."""
    image = bpy.data.images.load(str(path), check_existing=True)
    image.filepath = filepath
    if images.knows_space(space or LINEAR):
        image.colorspace_settings.name = space or LINEAR
    image.reload()
    return image


def _link_layers(tree, picture, node, objects: Sequence[ObjectLayers], path: Path) -> None:
    pairs = [(COMBINED, group.BASE), *((name, name) for each in objects for name in each.weights[1:])]
    for layer, socket in pairs:
        if layer not in picture.outputs:
            raise DataError("{path} has no layer {layer!r}.", "Render the layers again.", path=path, layer=layer)
        tree.links.new(picture.outputs[layer], node.inputs[socket])


def _free_targets(tree: bpy.types.NodeTree, node: bpy.types.Node) -> list[bpy.types.NodeSocket]:
    """What a new group is linked to: the rendered picture and the viewer, where nothing else is linked to them."""
    viewers = [each for each in tree.nodes if each.bl_idname == "CompositorNodeViewer"]
    if not viewers:
        viewers = [tree.nodes.new("CompositorNodeViewer")]
        viewers[0].location = node.location.x + 300, node.location.y - 150
    sockets = [compat.compositing_output(tree), viewers[0].inputs[0]]
    return [socket for socket in sockets if not socket.is_linked]


def is_rendered(node: bpy.types.Node) -> bool:
    """Whether what the node gives is what the scene renders."""
    output = compat.compositing_output(node.id_data)
    return any(link.to_socket == output for link in node.outputs[0].links)
