"""What marks do when Blender takes steps back, or opens another file."""

import bpy
from bpy.app.handlers import persistent

from ..host import handlers
from . import asking, history, mask_layers


@persistent
def _after_undo(*_):
    try:
        history.follow()
    except OSError as error:
        print(f"KaRF: masks do not follow undo: {error}")
    for scene in bpy.data.scenes:
        mask_layers.reread(scene)
        asking.follow(scene)


@persistent
def _after_load(*_):
    history.forget()
    mask_layers.forget()


HANDLERS = (("undo_post", _after_undo), ("redo_post", _after_undo), ("load_post", _after_load))


def register():
    """Called when the extension is enabled."""
    handlers.add(HANDLERS)


def unregister():
    """Called when the extension is disabled."""
    handlers.remove(HANDLERS)
    history.forget()
    mask_layers.forget()
