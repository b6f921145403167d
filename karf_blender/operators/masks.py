"""Step 3: coarse masks by painting over a photo."""

import bpy
from bpy.props import StringProperty

from .. import steps
from ..pictures import editors
from ..project import disk
from .reporting import has_project, reports_errors


class KARF_OT_paint_mask(bpy.types.Operator):
    """Paint over the object on a copy of the active view's photo, in a color that the object has not"""

    bl_idname = "karf.paint_mask"
    bl_label = "Paint Mask"
    bl_options = {"REGISTER", "UNDO"}

    object_name: StringProperty(name="Object", description="Empty: the panel's name", options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context):
        return has_project(cls, context)

    @reports_errors
    def execute(self, context):
        image = steps.paint_mask(context.scene, self.object_name or context.scene.karf.mask_object)
        if context.area and context.area.type == "IMAGE_EDITOR":
            context.space_data.image = image
        editors.reveal(image, is_wanted=True)
        editors.set_mode(image, "PAINT")
        self.report({"INFO"}, f"Paint over the object in {image.name!r}, then press Save Mask")
        return {"FINISHED"}


class KARF_OT_save_mask(bpy.types.Operator):
    """Write what is painted over the photo as a mask of the object"""

    bl_idname = "karf.save_mask"
    bl_label = "Save Mask"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context):
        if context.scene.karf.mask_image is None:
            cls.poll_message_set("Press Paint Mask first")
            return False
        return has_project(cls, context)

    @reports_errors
    def execute(self, context):
        file, share = steps.save_mask(context.scene)
        disk.refresh()
        editors.set_mode(context.scene.karf.mask_image, "VIEW")
        self.report({"INFO"}, f"{file}: {share:.1%} of the picture")
        return {"FINISHED"}


CLASSES = (KARF_OT_paint_mask, KARF_OT_save_mask)
