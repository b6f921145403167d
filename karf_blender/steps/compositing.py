"""Step 7: recoloring in Blender's compositor, which then needs neither the engine nor this extension."""

from functools import partial
from pathlib import Path

import bpy

from .. import progress
from ..compositor import placing
from ..engine_api import Message, Request, find_header, read_layer_names
from ..pictures import images
from ..project import captures, folders
from ..swatches import colors
from ..tasks.ownership import Owner
from ..tasks.runner import Task
from . import following, requests, sequences
from .edit import save_edit


def build_compositor(scene: bpy.types.Scene, view: str = "", driven: bool = False) -> Task:
    """Recolor a view by nodes in the scene's compositor, with a color socket for each swatch.

    Args:
        scene: The scene.
        view: Name of a captured view, whose layers the engine writes; default: the active one.
        driven: Whether the sockets follow the scene's swatches; else they begin with them and can be set by hand.

    Returns:
        The task; its result is the group's node.
    """
    view = captures.view_of(scene, view).name
    out = folders.out_folder(scene)
    finish = partial(_place, out / "layers" / f"{view}.exr", driven)
    edit = out / "edit.json" if colors.added_by_object(scene) or colors.edges(scene) else None
    if edit is not None:
        save_edit(scene, edit)
    job = requests.layers(scene, view, out, edit)
    return requests.task(scene, "Build Compositor", job, finish=finish, result=partial(compositor_node, scene, view))


def _place(path: Path, driven: bool, owner: Owner, request: Request) -> None:
    del request
    progress.wrote(path.parent)
    scene = requests.find_scene(owner, Message("The layers are in {path}.", path=path))
    if scene is not None:
        node = place_layers(scene, path, driven)
        progress.warn(Message("The compositor recolors {path} with the node {name}.", path=path, name=node.name))


def compositor_node(scene: bpy.types.Scene, view: str = "") -> bpy.types.Node | None:
    """The node that recolors a captured view (default: the active one) in the compositor, if there is one."""
    return placing.find(scene, view or scene.karf.active_view)


def place_layers(scene: bpy.types.Scene, path: str | Path, driven: bool = False) -> bpy.types.Node:
    """Recolor a layered picture that the engine has written (`render --layers`), of any camera, as `build_compositor` does.

    Returns:
        The group's node.

    Raises:
        DataError: The file is not a layered picture.
    """
    path = Path(path).absolute()
    objects = read_layer_names(path)
    known = following.known_of(scene, objects)
    node = placing.build(
        scene, path, folders.stored(path), objects, following.edited(scene, known), scene.karf.layer_space
    )
    _say_space(scene, path)
    if driven:
        following.follow(scene, node, known)
    following.say_others(scene, objects, "layers")
    _say_differences(scene, node, find_header(path).display_size)
    return node


def _say_space(scene: bpy.types.Scene, path: Path) -> None:
    """Warn where Blender does not know the layers' color space, so that it takes their picture for another one."""
    name = scene.karf.layer_space
    if name and not images.knows_space(name):
        progress.warn(
            Message(
                "Blender does not know the color space {name}: set the color space of {path} in its Image node.",
                name=name,
                path=path,
            )
        )


def _say_differences(scene: bpy.types.Scene, node: bpy.types.Node, size: tuple[int, int]) -> None:
    """Warn of what makes the rendered picture another than the recolored one, of `size`."""
    render = scene.render
    rendered = tuple(side * render.resolution_percentage // 100 for side in (render.resolution_x, render.resolution_y))
    if not placing.is_rendered(node):
        progress.warn(
            Message(
                "The compositor's output is connected to other nodes: link {name} where you want it.", name=node.name
            )
        )
    if size != rendered:
        progress.warn(
            Message(
                "The layers have {width} x {height} pixels, but the scene renders {own_width} x {own_height}.",
                width=size[0],
                height=size[1],
                own_width=rendered[0],
                own_height=rendered[1],
            )
        )
    sequences.say_view_transform(scene)
