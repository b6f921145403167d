"""Building node trees, materials that no light changes, and color sockets that follow a scene's swatches by drivers.

Where the extension is not installed, a driver takes its fallback value: the swatch's color when the file was saved.
"""

import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import bpy
import numpy as np

from . import session
from .engine_api import ObjectLayers, Palette, srgb_to_linear
from .host import compat

COLUMN, ROW = 190.0, 200.0  # distances between nodes, in units of the node editor
LONGEST = 48  # bytes of a name before its number: Blender cuts at 63
# of Blender's simple expressions, which run without the right to run scripts: of a color and what surfaces add to it
TO_LINEAR = "(v + s) / 12.92 if v + s <= 0.04045 else pow((v + s + 0.055) / 1.055, 2.4)"
# of files of before swatches had surfaces
COLOR_TO_LINEAR = "v / 12.92 if v <= 0.04045 else pow((v + 0.055) / 1.055, 2.4)"

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


# --- sockets of swatches -------------------------------------------------------------------------------------------
def swatch_socket(name: str, index: int) -> str:
    """Return the name of the socket of an object's swatch; swatches count from 1, as black stays black."""
    return f"{short(name)} {index}"


def short(name: str) -> str:
    """Return a name, cut and with its checksum if Blender would cut it."""
    encoded = name.encode()
    if len(encoded) <= LONGEST:
        return name
    return f"{encoded[: LONGEST - 9].decode(errors='ignore')} {zlib.crc32(encoded):08x}"


def swatches_of(objects: Iterable[Palette | ObjectLayers]) -> Iterator[tuple[Palette | ObjectLayers, int, str]]:
    """Yield each object, the index of each of its swatches, and the name of its socket."""
    for each in objects:
        for index in range(1, len(each.colors)):
            yield each, index, swatch_socket(each.name, index)


def scene_linear(color: Sequence[float]) -> tuple[float, float, float, float]:
    """Return the value of a color socket for an sRGB color."""
    return (*map(float, srgb_to_linear(color)), 1.0)


def set_colors(
    node: bpy.types.Node, objects: Iterable[Palette | ObjectLayers], edited: Mapping[str, np.ndarray]
) -> None:
    """Set the sockets of all swatches to the sRGB colors [M, 3] of `edited` by object name, else to the learned ones."""
    for each, index, socket in swatches_of(objects):
        node.inputs[socket].default_value = scene_linear(edited.get(each.name, each.colors)[index])


def drive(node: bpy.types.Node, name: str, index: int, scene: bpy.types.Scene, source: str) -> None:
    """Drive the socket of a swatch by its displayed color; `source` is the swatch's path from the scene."""
    socket = node.inputs[swatch_socket(name, index)]
    for channel in range(3):
        driver = socket.driver_add("default_value", channel).driver
        driver.type, driver.expression = "SCRIPTED", TO_LINEAR
        for variable_name, part in (("v", "color"), ("s", "shift")):
            variable = driver.variables.new()
            variable.name = variable_name
            target = variable.targets[0]
            target.id_type, target.id = "SCENE", scene
            target.data_path = f"{source}.{part}[{channel}]"
            target.use_fallback_value = True
            target.fallback_value = scene.path_resolve(target.data_path)


def remove_drivers(node: bpy.types.Node) -> None:
    """Remove the drivers of all inputs, which keep their values."""
    if node.id_data.animation_data is not None:
        for socket in node.inputs:
            if hasattr(socket, "default_value"):
                socket.driver_remove("default_value")


@session.handler("save_pre")
def _set_fallbacks(*_):
    compositors = [compat.compositing_tree_or_none(scene) for scene in bpy.data.scenes]
    for tree in {*compositors, *bpy.data.node_groups} - {None}:
        for curve in tree.animation_data.drivers if tree.animation_data is not None else ():
            if curve.driver.expression in (TO_LINEAR, COLOR_TO_LINEAR):
                for variable in curve.driver.variables:
                    _set_fallback(variable.targets[0])


def _set_fallback(target: bpy.types.DriverTarget) -> None:
    try:
        target.fallback_value = target.id.path_resolve(target.data_path)
    except (AttributeError, ValueError):  # the scene or the swatch is gone
        pass
