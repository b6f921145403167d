"""Live Camera on and off."""

import bpy

from ..project import disk
from ..steps import preview
from .reporting import reports_errors


class KARF_OT_live_camera(bpy.types.Operator):
    """Render the scene's camera with the swatches live in the Image Editor, coarse while it moves, fine at rest"""

    bl_idname = "karf.live_camera"
    bl_label = "Live Camera"

    @classmethod
    def poll(cls, context):
        if preview.is_live():
            return True
        if "geometry" not in disk.contents_of(context.scene).stages:
            cls.poll_message_set("Learn the scene first")
            return False
        if context.scene.camera is None:
            cls.poll_message_set("The scene has no camera")
            return False
        return True

    @reports_errors
    def execute(self, context):
        if preview.is_live():
            preview.stop()
        else:
            preview.start(context.scene)
        return {"FINISHED"}
