"""Clicking a captured camera in the 3D View makes it the active view.

The message bus reports only the user's clicks: undo restores the active view with the rest of the scene.
"""

import bpy

from .. import session
from ..host import rendering, windows


def choose_clicked(scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> None:
    """Make the view of the active object the active one, if that is one of the scene's captured cameras."""
    karf, clicked = scene.karf, layer.objects.active
    if clicked is None or clicked.parent is None or clicked.parent != karf.rig or clicked.karf_view not in karf.views:
        return
    if clicked.karf_view != karf.active_view and not rendering.is_running() and not _is_looking_through():
        karf.active_view = clicked.karf_view


def _is_looking_through() -> bool:
    """Return whether a 3D View shows a camera view: there a click means an object in the picture."""
    views = (area.spaces.active.region_3d for area in windows.areas("VIEW_3D"))
    return any(view is not None and view.view_perspective == "CAMERA" for view in views)


@session.subscribe((bpy.types.LayerObjects, "active"))
def _clicked() -> None:
    window = bpy.data.window_managers[0].windows[0]
    choose_clicked(window.scene, window.view_layer)
