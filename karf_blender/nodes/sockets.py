"""Color sockets of node groups, one for each swatch, and drivers that let them follow a scene's swatches.

Where the extension is not installed, a driver takes its fallback value: the swatch's color when the file was saved.
"""

import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence

import bpy
import numpy as np

from .. import session
from ..engine_api import ObjectLayers, Palette, srgb_to_linear
from ..host import compat

LONGEST = 48  # bytes of a name before its number: Blender cuts at 63
# of Blender's simple expressions, which run without the right to run scripts: of a color and what surfaces add to it
TO_LINEAR = "(v + s) / 12.92 if v + s <= 0.04045 else pow((v + s + 0.055) / 1.055, 2.4)"
# of files of before swatches had surfaces
COLOR_TO_LINEAR = "v / 12.92 if v <= 0.04045 else pow((v + 0.055) / 1.055, 2.4)"


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


# --- drivers -------------------------------------------------------------------------------------------------------
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
