"""Step 7: recoloring in Blender's compositor, which then needs neither the engine nor this extension."""

from functools import partial
from pathlib import Path

import bpy

from .. import progress
from ..compositor import drivers, placing
from ..engine_api import ObjectLayers, Request, find_header, read_layer_names
from ..project import captures, folders
from ..swatches import colors
from ..tasks.ownership import Owner
from ..tasks.task import Task
from . import requests, sequences


def build_compositor(scene: bpy.types.Scene, view: str = "", driven: bool = False) -> Task:
    """Have the engine write the layers of a captured view (default: the active one), then recolor it by nodes."""
    view = captures.view_of(scene, view).name
    out = folders.out_folder(scene)
    finish = partial(_place, out / "layers" / f"{view}.exr", driven)
    return requests.task(scene, "Build Compositor", requests.layers(view, out), finish=finish)


def _place(path: Path, driven: bool, owner: Owner, request: Request) -> None:
    del request
    scene = requests.find_scene(owner, f"The layers are in {path}.")
    if scene is not None:
        node = place_layers(scene, path, driven)
        progress.warn(f"The compositor recolors {path} by the node {node.name}.")


def compositor_node(scene: bpy.types.Scene, view: str = "") -> bpy.types.Node | None:
    """The node that recolors a captured view (default: the active one) in the compositor, if there is one."""
    return placing.find(scene, view or scene.karf.active_view)


def place_layers(scene: bpy.types.Scene, path: Path, driven: bool = False) -> bpy.types.Node:
    """Recolor a layered picture by nodes in the scene's compositor, with the scene's swatches where it has them.

    Args:
        scene: The scene.
        path: What `render --layers` has written.
        driven: Whether the nodes follow the scene's swatches from now on.

    Returns:
        The group's node.

    Raises:
        DataError: The file is no layered picture.
    """
    objects = read_layer_names(path)
    known = [each for each in objects if _fits(scene, each)]
    edited = {each.name: colors.edited(scene.karf.objects[each.name]) for each in known}
    node = placing.build(scene, path, folders.stored(path), objects, edited)
    for each in known if driven else ():
        for index in range(1, len(each.colors)):
            source = f'karf.objects["{bpy.utils.escape_identifier(each.name)}"].swatches[{index}].color'
            drivers.drive(node, each.name, index, scene, source)
    _say_others(scene, [each.name for each in objects if each not in known])
    _say_differences(scene, node, find_header(path).shown)
    return node


def _fits(scene: bpy.types.Scene, layers: ObjectLayers) -> bool:
    """Whether the scene has the swatches that the layers were made with."""
    item = scene.karf.objects.get(layers.name)
    return item is not None and colors.learned(item).tolist() == layers.colors.tolist()


def _say_others(scene: bpy.types.Scene, names: list[str]) -> None:
    """Warn of objects whose swatches in the scene are not those that the layers were made with."""
    others = [name for name in names if name in scene.karf.objects]
    if others:
        progress.warn(
            f"The swatches of {', '.join(others)} are of other palettes than the layers: the sockets begin as learned. "
            "Choose the project anew in step 1 to bring its palettes, then build again."
        )


def _say_differences(scene: bpy.types.Scene, node: bpy.types.Node, size: tuple[int, int]) -> None:
    """Warn of what makes the rendered picture another than the recolored one, of `size`."""
    render = scene.render
    rendered = tuple(side * render.resolution_percentage // 100 for side in (render.resolution_x, render.resolution_y))
    if not placing.is_rendered(node):
        progress.warn(f"The compositor's output has other nodes: link {node.name} where you want it.")
    if size != rendered:
        progress.warn(f"The layers have {size[0]} x {size[1]} pixels, the scene renders {rendered[0]} x {rendered[1]}.")
    sequences.say_view_transform(scene)
