"""Step 7: the scene by Blender's own ways: rendered 3D Views, stills and animations by the render engine KaRF."""

from collections.abc import Iterable

import bpy

from ..compositor import over_scene
from ..engine_api import BadRequest
from ..host import compat
from ..render_engine.engine import NAME
from . import sequences

COPIED = (
    "resolution_x",
    "resolution_y",
    "resolution_percentage",
    "pixel_aspect_x",
    "pixel_aspect_y",
    "fps",
    "fps_base",
)


def use_engine(scene: bpy.types.Scene, spaces: Iterable["bpy.types.SpaceView3D"] = ()) -> None:
    """Let KaRF render the scene.

    Args:
        scene: The scene.
        spaces: 3D Views that show it rendered from now on.
    """
    scene.render.engine = NAME
    for space in spaces:
        space.shading.type = "RENDERED"
    sequences.say_view_transform(scene)


def put_objects_in(scene: bpy.types.Scene) -> bpy.types.Scene:
    """Let renders show the scene's own objects within the captured one, each hidden where the other is nearer.

    The objects are rendered as a scene of their own, by the engine that the scene has had, or by EEVEE. Done again, it
    holds what the scene holds now.

    Returns:
        The scene of the objects.

    Raises:
        BadRequest: The scene has no captured cameras.
    """
    if scene.karf.rig is None:
        raise BadRequest("The scene {name!r} has no captured cameras.", "Import the capture first.", name=scene.name)
    name = f"{scene.name} {over_scene.OBJECTS}"
    objects = bpy.data.scenes.get(name)
    if objects is None:
        objects = bpy.data.scenes.new(name)
        objects.render.engine = compat.EEVEE if scene.render.engine == NAME else scene.render.engine
    _take_over(scene, objects)
    use_engine(scene)
    for each in (scene, objects):
        each.view_layers[0].use_pass_z = True
    over_scene.build(scene, objects)
    return objects


def _take_over(scene: bpy.types.Scene, objects: bpy.types.Scene) -> None:
    """Give the scene of the objects what the other one has now: all but the capture."""
    objects.camera, objects.world = scene.camera, scene.world
    objects.frame_start, objects.frame_end = scene.frame_start, scene.frame_end
    objects.view_settings.view_transform = scene.view_settings.view_transform
    objects.render.film_transparent = True
    for name in COPIED:
        setattr(objects.render, name, getattr(scene.render, name))
    source, target, rig = scene.collection, objects.collection, scene.karf.rig
    for held in (target.children, target.objects):
        for each in list(held):
            held.unlink(each)
    for collection in source.children:
        if rig.name not in collection.objects:
            target.children.link(collection)
    for item in source.objects:
        if item not in (rig, scene.karf.surface.item):
            target.objects.link(item)
