"""The object in the scene: made once below the rig, and filled anew where there are other points."""

from collections.abc import Iterable, Mapping, Sequence

import bpy
import numpy as np

from ..engine_api import Palette, ScenePoints
from ..nodes import drivers, shadeless, sockets
from . import mesh, trees

NAME = "KaRF scene"


def find(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """The object that shows the learned scene, if there is one."""
    item = scene.karf.surface.item
    return item if is_in(scene, item) else None


def is_in(scene: bpy.types.Scene, item: bpy.types.Object | None) -> bool:
    """Whether an object that a property names is in the scene: one that was deleted lives on in the property."""
    return item is not None and scene.objects.get(item.name) == item


def build(
    item: bpy.types.Object | None,
    rig: bpy.types.Object,
    points: ScenePoints,
    palettes: Sequence[Palette],
    edited: Mapping[str, np.ndarray],
) -> tuple[bpy.types.Object, bpy.types.Node]:
    """Show points as an object below the rig.

    Args:
        item: The object that showed points before, if there is one: it keeps its name, its place and what was done to
            it, and gets these points.
        rig: The capture's Empty.
        points: The points.
        palettes: Their objects', as learned.
        edited: Palettes [M, 3] that the sockets begin with, by the object's name; others begin as learned.

    Returns:
        The object, and the node with the swatches' sockets.
    """
    data = mesh.build(NAME, points)
    if item is None:
        item = bpy.data.objects.new(NAME, data)
        item.parent = rig
        for collection in rig.users_collection:
            collection.objects.link(item)
    else:
        old, item.data = item.data, data
        bpy.data.meshes.remove(old)
    data.materials.append(shadeless.material(NAME, mesh.COLOR))
    tree = _tree(item)
    if (node := recolor_node(item)) is not None:
        drivers.remove(node)
    node = trees.fill(tree, palettes)
    for each in palettes:
        colors = edited.get(each.name, each.colors)
        for index in range(1, len(each.colors)):
            node.inputs[sockets.swatch_socket(each.name, index)].default_value = sockets.scene_linear(colors[index])
    return item, node


def _tree(item: bpy.types.Object) -> bpy.types.NodeTree:
    """The node tree of the object's own modifier, made where there is none."""
    modifier = item.modifiers.get(NAME)
    if modifier is None or modifier.type != "NODES":
        modifier = item.modifiers.new(NAME, "NODES")
    if modifier.node_group is None:
        modifier.node_group = bpy.data.node_groups.new(item.name, "GeometryNodeTree")
    return modifier.node_group


def recolor_node(item: bpy.types.Object) -> bpy.types.Node | None:
    """The node with the swatches' sockets, if there is one."""
    return _node(item, trees.RECOLOR)


def radius_node(item: bpy.types.Object) -> bpy.types.Node | None:
    """The node that says how large faces are, if there is one."""
    return _node(item, trees.RADIUS)


def _node(item: bpy.types.Object, name: str) -> bpy.types.Node | None:
    modifier = item.modifiers.get(NAME)
    tree = modifier.node_group if modifier is not None and modifier.type == "NODES" else None
    return tree.nodes.get(name) if tree is not None else None


def show_colors(spaces: Iterable["bpy.types.SpaceView3D"]) -> None:
    """Let 3D Views show the colors of meshes as they are, in Solid mode."""
    for space in spaces:
        space.shading.type, space.shading.light, space.shading.color_type = "SOLID", "FLAT", "VERTEX"
