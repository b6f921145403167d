"""Photos behind captured cameras are hidden while a 3D View of the scene shows the render engine's picture."""

import bpy

from .. import session
from ..host import rendering, windows
from ..rig import cameras
from .engine import NAME


@session.subscribe((bpy.types.View3DShading, "type"), (bpy.types.RenderSettings, "engine"))
def follow(*_) -> None:
    """Hide the photos of each scene with a 3D View rendered by KaRF; show those of other scenes."""
    if rendering.is_running():
        return
    rendered = {
        windows.window_of(area).scene
        for area in windows.areas("VIEW_3D")
        if area.spaces.active.shading.type == "RENDERED"
    }
    for scene in bpy.data.scenes:
        if scene.library is None:
            cameras.hide_photos(scene, scene.render.engine == NAME and scene in rendered)


@session.draw_handler(bpy.types.SpaceView3D, "POST_PIXEL")
def _follow_keys() -> None:
    follow()  # Shift Z and other workspaces announce nothing


@session.setup
def _show_again():
    yield
    for scene in bpy.data.scenes if hasattr(bpy.types.Scene, "karf") else ():
        cameras.hide_photos(scene, False)
