"""Step 5: recoloring by Blender's own nodes, in the compositor and on an object, without engine or extension."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import bpy
import numpy as np

from .. import compositor, progress
from ..engine_api import (
    BadRequest,
    Message,
    ObjectLayers,
    Palette,
    extended_palettes,
    find_header,
    read_layer_names,
    read_points,
)
from ..host import windows
from ..nodes import drive
from ..pictures import images
from ..project import captures, folders
from ..surface import export, scene_object
from ..swatches import colors
from ..tasks.runner import Task
from . import requests
from .render import warn_of_view_transform
from .swatches import save_edit

_Learned = Palette | ObjectLayers  # what nodes are made of: the name of an object, and its learned palette


def build_compositor(scene: bpy.types.Scene, view: str = "", driven: bool = False) -> Task:
    """Recolor a captured view (default: the active one) by compositor nodes, with a color socket for each swatch.

    The sockets begin with the scene's swatches, and follow them if `driven`. The task's result is the group's node.
    """
    view = captures.view_of(scene, view).name
    out = folders.out_folder(scene)
    path = out / "layers" / f"{view}.exr"
    edit = out / "edit.json" if colors.added_by_object(scene) or colors.edges(scene) else None
    if edit is not None:
        save_edit(scene, edit)

    def present(found: bpy.types.Scene) -> None:
        node = place_layers(found, path, driven)
        progress.warn("The compositor recolors {path} with the node {name}.", path=path, name=node.name)

    finish = requests.presenting(present, Message("The layers are in {path}.", path=path), path.parent)
    spaces = {"layer_space": scene.karf.layer_space or None, "ocio": folders.text_of(scene, "ocio") or None}
    job = requests.render(view, out=str(out), layers=True, edit=edit and str(edit), **spaces)
    return requests.task(scene, "Build Compositor", job, finish=finish, result=partial(compositor.find, scene, view))


def place_layers(scene: bpy.types.Scene, path: str | Path, driven: bool = False) -> bpy.types.Node:
    """Recolor a layered picture by the engine (`render --layers`), of any camera, as `build_compositor` does."""
    path = Path(path).absolute()
    objects = read_layer_names(path)
    known = _with_swatches(scene, objects)
    node = compositor.build(scene, path, folders.stored(path), objects, _edited(scene, known), scene.karf.layer_space)
    space = scene.karf.layer_space
    if space and not images.knows_space(space):  # it takes their picture for another one
        progress.warn(
            "Blender does not know the color space {name}: set the color space of {path} in its Image node.",
            name=space,
            path=path,
        )
    if driven:
        _follow(scene, node, known)
    _warn_of_others(scene, objects, "layers")
    _warn_of_differences(scene, node, find_header(path).display_size)
    return node


def _warn_of_differences(scene: bpy.types.Scene, node: bpy.types.Node, size: tuple[int, int]) -> None:
    """Warn of what makes the rendered picture another than the recolored one, of `size`."""
    render = scene.render
    rendered = tuple(side * render.resolution_percentage // 100 for side in (render.resolution_x, render.resolution_y))
    if not compositor.is_rendered(node):
        progress.warn(
            "The compositor's output is connected to other nodes: link {name} where you want it.", name=node.name
        )
    if size != rendered:
        progress.warn(
            "The layers have {width} x {height} pixels, but the scene renders {own_width} x {own_height}.",
            width=size[0],
            height=size[1],
            own_width=rendered[0],
            own_height=rendered[1],
        )
    warn_of_view_transform(scene)


def show_scene(scene: bpy.types.Scene, count: int | None = None) -> Task:
    """Show the learned scene as an object of about `count` points, the task's result, that follows the swatches."""
    path = folders.project_of(scene).points_file
    job = "points", {"out": str(path), "count": count or scene.karf.surface.count}
    finish = requests.presenting(partial(place_points, path=path), Message("The points are in {path}.", path=path))
    return requests.task(scene, "Show in 3D View", job, finish=finish, result=lambda: scene.karf.surface.item)


def place_points(scene: bpy.types.Scene, path: str | Path) -> bpy.types.Object:
    """Show points that the engine has written (`points --out FILE.npz`) as `show_scene` does; returns the object."""
    requests.check_rig(scene)
    karf, points = scene.karf, read_points(Path(path).absolute())
    learned = zip(points.objects, points.learned, strict=True)
    palettes = [_as_long_as_swatches(scene, Palette(*each)) for each in learned]
    ours = {each.name for each in _with_swatches(scene, palettes)}
    added = {name: own for name, own in colors.added_by_object(scene).items() if name in ours}
    points = points.with_edges(palettes, {name: own for name, own in colors.edges(scene).items() if name in ours})
    points, palettes = points.with_added(palettes, added), extended_palettes(palettes, added)
    known, before = _with_swatches(scene, palettes), scene_object.find(scene)
    karf.surface.item, node = scene_object.build(before, karf.rig, points, palettes, _edited(scene, known))
    _follow(scene, node, known)
    _warn_of_others(scene, palettes, "points")
    warn_of_view_transform(scene)
    if before is None:  # lit, its small faces would be gray noise
        spaces = [area.spaces.active for area in windows.areas("VIEW_3D")]
        scene_object.show_colors(space for space in spaces if space.shading.type == "SOLID")
    return karf.surface.item


def _as_long_as_swatches(scene: bpy.types.Scene, palette: Palette) -> Palette:
    """Return a palette without the zeros that pad it to the longest."""
    item = scene.karf.objects.get(palette.name)
    return palette if item is None else Palette(palette.name, palette.colors[: colors.size(item)])


def export_scene(scene: bpy.types.Scene, path: str | Path, shape: str = "quads") -> Path:
    """Write the scene's object (.ply, .glb, .gltf, .usd, .usda or .usdc) as `quads` or `points`; return its path."""
    item = scene_object.find(scene)
    if item is None:
        raise BadRequest("The scene is not shown in 3D yet.", "Press Show in 3D View first.")
    path = Path(path).absolute()
    export.export(scene, item, path, shape)
    return path


def _with_swatches(scene: bpy.types.Scene, objects: Sequence[_Learned]) -> list[_Learned]:
    return [each for each in objects if _is_ours(scene, each)]


def _is_ours(scene: bpy.types.Scene, each: _Learned) -> bool:
    item = scene.karf.objects.get(each.name)
    if item is None or len(each.colors) < colors.size(item):
        return False
    return colors.learned(item)[_kept(item)][: len(each.colors)].tolist() == each.colors.tolist()


def _kept(item: bpy.types.PropertyGroup) -> np.ndarray:
    """Return the numbers of the swatches that an edit has."""
    return np.flatnonzero(colors.state(item).kept)


def _edited(scene: bpy.types.Scene, known: Sequence[_Learned]) -> Mapping[str, np.ndarray]:
    """Palettes [M, 3] as the swatches stand, by the object's name."""
    items = [scene.karf.objects[each.name] for each in known]
    return {
        item.name: colors.edited(item)[_kept(item)][: len(each.colors)] for item, each in zip(items, known, strict=True)
    }


def _follow(scene: bpy.types.Scene, node: bpy.types.Node, known: Sequence[_Learned]) -> None:
    """Drive the node's sockets by the scene's swatches."""
    for each in known:
        numbers = _kept(scene.karf.objects[each.name])
        for index in range(1, len(each.colors)):
            source = f'karf.objects["{bpy.utils.escape_identifier(each.name)}"].swatches[{numbers[index]}]'
            drive(node, each.name, index, scene, source)


def _warn_of_others(scene: bpy.types.Scene, objects: Sequence[_Learned], what: str) -> None:
    """Warn of objects whose swatches in the scene are not those that `what` was made with."""
    items = scene.karf.objects
    others = [each.name for each in objects if each.name in items and not _is_ours(scene, each)]
    if others:
        progress.warn(
            "The swatches of {names} belong to other palettes than the {what}: the sockets start with the "
            "learned colors. Choose the project again in step 1 to load its palettes, then build again.",
            names=", ".join(others),
            what=what,
        )
    ours = _with_swatches(scene, objects)
    fewer = [each.name for each in ours if len(each.colors) < len(_kept(items[each.name]))]
    if fewer:
        progress.warn(
            "The {what} lacks colors that were added to {names}: build again to include them.",
            names=", ".join(fewer),
            what=what,
        )
