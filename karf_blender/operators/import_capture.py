"""Step 1: a capture becomes cameras."""

from pathlib import Path

import bpy
from bpy.props import StringProperty

from .. import steps
from .reporting import has_project, reports_errors


class KARF_OT_import_capture(bpy.types.Operator):
    """Make a camera for every photo of a capture (transforms.json, LLFF or COLMAP; its folder or camera file)"""

    bl_idname = "karf.import_capture"
    bl_label = "Import Capture"
    bl_options = {"REGISTER", "UNDO"}

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    project: StringProperty(name="Project", subtype="DIR_PATH", description="Empty: beside the .blend")
    filter_glob: StringProperty(default="*.json;*.npy;*.bin;*.txt", options={"HIDDEN"})

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    @reports_errors
    def execute(self, context):
        project = Path(bpy.path.abspath(self.project)) if self.project else None
        capture = steps.import_capture(context.scene, Path(bpy.path.abspath(self.filepath)), project)
        for remark in capture.remarks:
            self.report({"WARNING"}, remark)
        if any(view.camera.distortion for view in capture.views):
            self.report({"WARNING"}, "The photos have lens distortion: backgrounds show them as they are stored")
        self.report({"INFO"}, f"{len(capture.views)} cameras from {capture.source}")
        return {"FINISHED"}


class KARF_OT_look_through(bpy.types.Operator):
    """Look through the active view's camera, with its photo's size"""

    bl_idname = "karf.look_through"
    bl_label = "Look Through"
    bl_options = {"REGISTER", "UNDO"}

    view: StringProperty(name="View", description="Empty: the active view", options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context):
        return has_project(cls, context)

    @reports_errors
    def execute(self, context):
        steps.look_through(context.scene, self.view)
        if context.area and context.area.type == "VIEW_3D":
            context.space_data.region_3d.view_perspective = "CAMERA"
        return {"FINISHED"}


CLASSES = (KARF_OT_import_capture, KARF_OT_look_through)
