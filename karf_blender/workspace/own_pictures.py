"""Image Editors show the picture of their window's scene: after another file or scene is opened, and after undo."""

import bpy

from .. import session
from ..engine_api import KarfError
from ..host import rendering
from ..pictures import editors
from ..project import disk
from ..swatches import displayed, palettes
from ..tasks import runner


def show_again() -> None:
    """Show the recolored picture in Image Editors that are empty or show a lost picture of KaRF. Never raises."""
    for window in bpy.data.window_managers[0].windows:
        make(window.scene)
        result = window.scene.karf.result
        for area in _image_editors(window) if result is not None else ():
            if editors.is_empty(area):
                editors.show(area, result)


def make(scene: bpy.types.Scene) -> None:
    """Make the recolored picture of a scene that has none, if its view is prepared. Never raises."""
    karf = scene.karf
    if karf.result is not None or not karf.objects or not karf.project or rendering.is_running():
        return
    try:
        if disk.is_prepared(scene):
            displayed.of(scene).recolor()
    except (KarfError, OSError) as error:  # nobody has asked for it
        print(f"KaRF: {error}")


@session.subscribe((bpy.types.Window, "scene"))
def show_own() -> None:
    """Show in each Image Editor the picture of its window's scene, and never another scene's."""
    for window in bpy.data.window_managers[0].windows:
        results = {scene.karf.result for scene in bpy.data.scenes} - {None, window.scene.karf.result}
        for area in _image_editors(window):
            if area.spaces.active.image in results:
                editors.show(area, window.scene.karf.result)
    show_again()


def _image_editors(window: bpy.types.Window) -> list[bpy.types.Area]:
    return [area for area in window.screen.areas if area.type == "IMAGE_EDITOR"]


@session.handler("load_post", phase=session.Phase.REPORT)
def _after_load(*_):
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
