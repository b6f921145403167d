"""What saving a .blend needs: pictures that are only in memory are packed, relative paths rewritten."""

import bpy
from bpy.app.handlers import persistent

from ..host import handlers
from . import folders


@persistent
def _before_save(target, *_):
    # pixels that are only in memory are not saved
    for scene in bpy.data.scenes:
        image = scene.karf.result
        if image is not None and image.is_dirty:
            image.pack()
    if isinstance(target, str) and target:
        folders.rebase(bpy.data.filepath, target)


@persistent
def _after_save(target, *_):
    # a saved copy and a file that could not be written leave the open file where it was
    if isinstance(target, str) and target:
        folders.rebase(target, bpy.data.filepath)


HANDLERS = (("save_pre", _before_save), ("save_post", _after_save), ("save_post_fail", _after_save))


def register():
    """Called when the extension is enabled."""
    handlers.add(HANDLERS)


def unregister():
    """Called when the extension is disabled."""
    handlers.remove(HANDLERS)
