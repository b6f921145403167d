"""Viewing through a captured camera, which needs the scene's camera and its picture size and pixel aspect.

The scene stores what it had before, and gets it back on leaving.
"""

import bpy

from ..engine_api import View
from . import cameras, lens

PICTURE = ("resolution_x", "resolution_y", "resolution_percentage", "pixel_aspect_x", "pixel_aspect_y")


def look_through(scene: bpy.types.Scene, view: View) -> None:
    """Make a view's camera the scene's, with its photo's picture; remember once what the scene had before.

    Raises:
        BadRequest: The camera was deleted.
    """
    looking, camera = scene.karf.looking, cameras.camera_of(scene, view.name)
    if not looking.is_on:
        looking.is_on, looking.camera, looking.before = True, scene.camera, _picture(scene)
    scene.camera = camera
    lens.set_picture(scene, view.camera)
    looking.during = _picture(scene)
    hide_others(scene)


def leave(scene: bpy.types.Scene) -> None:
    """Restore camera and picture, except for what the user has changed since."""
    looking = scene.karf.looking
    if scene.camera is not None and scene.camera.karf_view:
        scene.camera = looking.camera
    if _picture(scene) == list(looking.during):
        for name, value in zip(PICTURE, looking.before, strict=True):
            setattr(scene.render, name, type(getattr(scene.render, name))(value))
    looking.is_on = False
    hide_others(scene)


def hide_others(scene: bpy.types.Scene) -> None:
    """Hide the rig's other cameras and its points while viewing, if the user wants that; else show what this has hidden."""
    looking, layer = scene.karf.looking, scene.view_layers[0]
    for item in scene.karf.rig.children if scene.karf.rig else ():
        if item.name not in layer.objects:
            continue
        is_unwanted = looking.is_on and looking.hides_others and item != scene.camera
        if is_unwanted and not item.hide_get(view_layer=layer):
            item.karf_hidden = True
            item.hide_set(True, view_layer=layer)
        elif item.karf_hidden and not is_unwanted:
            item.karf_hidden = False
            item.hide_set(False, view_layer=layer)


def _picture(scene: bpy.types.Scene) -> list[float]:
    return [float(getattr(scene.render, name)) for name in PICTURE]
