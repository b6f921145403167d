"""Undo takes the scene back, but not what jobs have learned: the palettes on the disk are the scene's again."""

import bpy

from .. import session
from ..host import rendering
from ..swatches import palettes
from ..tasks import runner
from . import own_pictures


@session.handler("undo_post", "redo_post", phase=session.Phase.REPORT)
def _after_undo(*_):
    if rendering.is_running() or runner.is_running():  # which brings what it learns when it ends
        return
    for scene in bpy.data.scenes:
        palettes.import_learned(scene)
        own_pictures.make(scene)
    own_pictures.show_again()
