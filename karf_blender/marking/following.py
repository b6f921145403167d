"""What marks do when Blender takes steps back, or opens another file."""

import bpy

from .. import session
from . import asking, history, mask_layers


@session.handler("undo_post", "redo_post", phase=session.Phase.READ)
def _after_undo(*_):
    try:
        history.follow()
    except OSError as error:
        print(f"KaRF: masks do not follow undo: {error}")
    for scene in bpy.data.scenes:
        mask_layers.reread(scene)
        asking.follow(scene)


@session.handler("load_post", phase=session.Phase.READ)
def _after_load(*_):
    history.forget()
    mask_layers.forget()
