"""Undo takes the scene back, but not what jobs have learned: the palettes on the disk are the scene's again."""

import bpy
from bpy.app.handlers import persistent

from ..host import handlers, rendering
from ..swatches import palettes
from ..tasks import runner
from . import own_pictures


@persistent
def _after_undo(*_):
    if rendering.is_running() or runner.is_running():  # which brings what it learns when it ends
        return
    for scene in bpy.data.scenes:
        palettes.import_learned(scene)
        own_pictures.make(scene)
    own_pictures.show_again()


HANDLERS = (("undo_post", _after_undo), ("redo_post", _after_undo))


def register():
    """Called when the extension is enabled."""
    handlers.add(HANDLERS)


def unregister():
    """Called when the extension is disabled."""
    handlers.remove(HANDLERS)
