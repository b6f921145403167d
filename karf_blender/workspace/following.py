"""What follows the user: Image Editors show the picture of their window's scene, and a clicked camera is the active view.

The message bus reports only what the user does; after undo and when a file is opened, Image Editors are updated too.
"""

import bpy

from .. import session
from ..host import rendering, windows
from ..pictures import editors
from ..progress import printing_errors
from ..project import disk
from ..swatches import displayed, palettes
from ..tasks import runner


@session.handler("load_post", phase=session.Phase.REPORT)
def show_again(*_) -> None:
    """Show the recolored picture in Image Editors that are empty or show a lost picture of KaRF. Never raises."""
    for window in bpy.data.window_managers[0].windows:
        make(window.scene)
    for area in windows.areas("IMAGE_EDITOR"):
        result = windows.window_of(area).scene.karf.result
        if result is not None and editors.is_empty(area):
            editors.show(area, result)


def make(scene: bpy.types.Scene) -> None:
    """Make the recolored picture of a scene that has none, if its view is prepared. Never raises."""
    karf = scene.karf
    if karf.result is not None or not karf.objects or not karf.project or rendering.is_running():
        return
    with printing_errors():  # nobody has asked for it
        if disk.is_prepared(scene):
            displayed.of(scene).recolor()


@session.subscribe((bpy.types.Window, "scene"))
def show_own() -> None:
    """Show in each Image Editor the picture of its window's scene, and never another scene's."""
    results = {scene.karf.result for scene in bpy.data.scenes} - {None}
    for area in windows.areas("IMAGE_EDITOR"):
        own = windows.window_of(area).scene.karf.result
        if area.spaces.active.image in results - {own}:
            editors.show(area, own)
    show_again()


@session.handler("undo_post", "redo_post", phase=session.Phase.REPORT)
def _after_undo(*_):
    # undo takes the scene back, but not what jobs have learned: the palettes on the disk are the scene's again
    if rendering.is_running() or runner.is_running():  # which brings what it learns when it ends
        return
    for scene in bpy.data.scenes:
        palettes.import_learned(scene)
        make(scene)
    show_again()


# --- a clicked camera ----------------------------------------------------------------------------------------------
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
