"""Building node trees, and materials that no light changes."""

from collections.abc import Mapping, Sequence
from typing import Any

import bpy

from ..host import compat

COLUMN, ROW = 190.0, 200.0  # distances between nodes, in units of the node editor

Place = tuple[float, float]  # column and row in the node editor


def add(
    tree: bpy.types.NodeTree, kind: str, place: Place, inputs: Mapping[str, Any] | Sequence[Any] = (), **properties: Any
) -> bpy.types.Node:
    """Add a node with some properties, and give its inputs, by name or in order, values or other nodes' outputs."""
    node = tree.nodes.new(kind)
    put(node, place)
    for name, value in properties.items():
        setattr(node, name, value)
    if isinstance(inputs, Mapping):
        pairs = [(enabled(node.inputs, name), value) for name, value in inputs.items()]
    else:
        pairs = zip(node.inputs, inputs, strict=False)
    for socket, value in pairs:
        feed(socket, value)
    return node


def named(tree: bpy.types.NodeTree, name: str, kind: str, location: tuple[float, float]) -> bpy.types.Node:
    """Return the node of a name and kind; one made at this location if missing."""
    node = tree.nodes.get(name)
    if node is None or node.bl_idname != kind:
        node = tree.nodes.new(kind)
        node.name = node.label = name
        node.location = location
    return node


def put(node: bpy.types.Node, place: Place) -> None:
    """Move a node to a column and row."""
    node.location = place[0] * COLUMN, -place[1] * ROW


def feed(socket: bpy.types.NodeSocket, value: Any) -> None:
    """Give an input a value or another node's output."""
    if isinstance(value, bpy.types.NodeSocket):
        socket.id_data.links.new(value, socket)
    else:
        socket.default_value = value


def enabled(sockets: Sequence[bpy.types.NodeSocket], name: str) -> bpy.types.NodeSocket:
    """Return the enabled socket of a name: some nodes have one for each data type."""
    return next(socket for socket in sockets if socket.name == name and socket.enabled)


def shadeless_material(name: str, attribute: str) -> bpy.types.Material:
    """Return the material of a name, made if missing, that shows an attribute as it is."""
    material = bpy.data.materials.get(name)
    if material is None:
        material, light = _new_material(name, "Emission")
        source = add(material.node_tree, "ShaderNodeAttribute", (-1, 0), attribute_name=attribute)
        feed(light.inputs["Color"], source.outputs["Color"])
    return material


def unlit_material(name: str) -> bpy.types.Material:
    """Make a white material that exporters write as an unlit one."""
    material, light = _new_material(name, "Background")
    light.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    return material


def _new_material(name: str, shader: str) -> tuple[bpy.types.Material, bpy.types.Node]:
    material = bpy.data.materials.new(name)
    compat.give_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    light = add(tree, f"ShaderNode{shader}", (0, 0))
    add(tree, "ShaderNodeOutputMaterial", (1, 0), {"Surface": light.outputs[0]})
    return material, light
