"""Step 7: the learned scene as an object in the 3D View, which then needs neither the engine nor this extension."""

from functools import partial
from pathlib import Path

import bpy

from ..engine_api import BadRequest, Message, Palette, Request, extended_palettes, read_points
from ..host import windows
from ..project import folders
from ..surface import export, scene_object
from ..swatches import colors
from ..tasks.ownership import Owner
from ..tasks.runner import Task
from . import following, requests, sequences


def show_scene(scene: bpy.types.Scene, count: int | None = None) -> Task:
    """Show the learned scene as an object whose colors follow the swatches.

    Args:
        scene: The scene.
        count: About how many points; default: the panel's.

    Returns:
        The task; its result is the object: the one that showed the scene before, where there is one.
    """
    path = folders.project_of(scene).points_file
    job = "points", {"out": str(path), "count": count or scene.karf.surface.count}
    return requests.task(
        scene, "Show in 3D View", job, finish=partial(_place, path), result=lambda: scene.karf.surface.item
    )


def _place(path: Path, owner: Owner, request: Request) -> None:
    del request
    scene = requests.find_scene(owner, Message("The points are in {path}.", path=path))
    if scene is not None:
        place_points(scene, path)


def place_points(scene: bpy.types.Scene, path: str | Path) -> bpy.types.Object:
    """Show points that the engine has written (`points --out FILE.npz`) as `show_scene` does.

    Returns:
        The object: the one that showed the scene before, where there is one.

    Raises:
        BadRequest: The scene has no rig.
        DataError: The file holds no points.
    """
    karf = scene.karf
    if karf.rig is None:
        raise BadRequest("The scene {name!r} has no captured cameras.", "Import the capture first.", name=scene.name)
    points = read_points(Path(path).absolute())
    palettes = [Palette(name, colors) for name, colors in zip(points.objects, points.learned, strict=True)]
    palettes = [_as_long_as_swatches(scene, each) for each in palettes]
    ours = {each.name for each in following.known_of(scene, palettes)}
    added = {name: own for name, own in colors.added_by_object(scene).items() if name in ours}
    points = points.with_edges(palettes, {name: own for name, own in colors.edges(scene).items() if name in ours})
    points, palettes = points.with_added(palettes, added), extended_palettes(palettes, added)
    known = following.known_of(scene, palettes)
    is_first = scene_object.find(scene) is None
    karf.surface.item, node = scene_object.build(
        scene_object.find(scene), karf.rig, points, palettes, following.edited(scene, known)
    )
    following.follow(scene, node, known)
    following.say_others(scene, palettes, "points")
    sequences.say_view_transform(scene)
    if is_first:  # lit, its small faces would be gray noise
        spaces = [area.spaces.active for area in windows.areas("VIEW_3D")]
        scene_object.show_colors(space for space in spaces if space.shading.type == "SOLID")
    return karf.surface.item


def _as_long_as_swatches(scene: bpy.types.Scene, palette: Palette) -> Palette:
    """A palette without the zeros behind its end, which are there where others are longer."""
    item = scene.karf.objects.get(palette.name)
    return palette if item is None else Palette(palette.name, palette.colors[: colors.size(item)])


def export_scene(scene: bpy.types.Scene, path: str | Path, shape: str = "quads") -> Path:
    """Write the scene's object with its colors as they are now.

    Args:
        scene: The scene.
        path: The file: `.ply`, `.glb`, `.gltf`, `.usd`, `.usda` or `.usdc`.
        shape: `quads`, as Blender shows it, or `points`, a vertex each.

    Returns:
        The file's path.

    Raises:
        BadRequest: There is no such object, or no such kind of file.
    """
    item = scene_object.find(scene)
    if item is None:
        raise BadRequest("The scene is not shown in 3D yet.", "Press Show in 3D View first.")
    path = Path(path).absolute()
    export.export(scene, item, path, shape)
    return path
