"""What saving a .blend needs: pictures that are only in memory are packed, relative paths rewritten."""

import bpy

from .. import session
from . import folders


@session.handler("save_pre")
def _before_save(target, *_):
    # pixels that are only in memory are not saved
    for scene in bpy.data.scenes:
        image = scene.karf.result
        if image is not None and image.is_dirty:
            image.pack()
    if isinstance(target, str) and target:
        folders.rebase(bpy.data.filepath, target)


@session.handler("save_post", "save_post_fail")
def _after_save(target, *_):
    # a saved copy and a file that could not be written leave the open file where it was
    if isinstance(target, str) and target:
        folders.rebase(target, bpy.data.filepath)
