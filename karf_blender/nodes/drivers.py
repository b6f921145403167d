"""Sockets that follow a scene's swatches.

A file may be opened where the extension is not installed and the swatches are unknown: then a driver takes its fallback
value, which is the swatch's as the file was saved.
"""

from collections.abc import Iterator

import bpy

from .. import session
from ..host import compat
from .sockets import swatch_socket

# of Blender's simple expressions, which run without the right to run scripts: of a color and what surfaces add to it
TO_LINEAR = "(v + s) / 12.92 if v + s <= 0.04045 else pow((v + s + 0.055) / 1.055, 2.4)"
# of files of before swatches had surfaces
COLOR_TO_LINEAR = "v / 12.92 if v <= 0.04045 else pow((v + 0.055) / 1.055, 2.4)"


def drive(node: bpy.types.Node, name: str, index: int, scene: bpy.types.Scene, source: str) -> None:
    """Let the socket of a swatch follow its color as it is shown. `source` is the swatch's path from the scene."""
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


def remove(node: bpy.types.Node) -> None:
    """Let all sockets of a node keep the values that they have."""
    if node.id_data.animation_data is not None:
        for socket in node.inputs:
            if hasattr(socket, "default_value"):
                socket.driver_remove("default_value")


def _targets() -> Iterator[bpy.types.DriverTarget]:
    """What follows swatches in all node trees."""
    compositors = [tree for scene in bpy.data.scenes if (tree := compat.compositing_tree_or_none(scene)) is not None]
    for tree in {*compositors, *bpy.data.node_groups}:
        for curve in tree.animation_data.drivers if tree.animation_data is not None else ():
            if curve.driver.expression in (TO_LINEAR, COLOR_TO_LINEAR):
                yield from (target for variable in curve.driver.variables for target in variable.targets)


@session.handler("save_pre")
def _before_save(*_):
    for target in _targets():
        try:
            target.fallback_value = target.id.path_resolve(target.data_path)
        except (AttributeError, ValueError):  # the scene or the swatch is gone
            continue
