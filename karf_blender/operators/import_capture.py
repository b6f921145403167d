"""Step 1: a capture becomes cameras."""

from pathlib import Path

import bpy
from bpy.props import StringProperty

from .. import steps
from ..engine_api import CAPTURE_MARKS
from .reporting import has_project, reports_errors


def look_from_camera(area) -> None:
    """Let a 3D View look through the scene's camera; other areas (or none) are left alone."""
    if area is not None and area.type == "VIEW_3D":
        view = area.spaces.active
        view.region_3d.view_perspective = "CAMERA"
        # the lines from all cameras to their Empty would cover the photo
        view.overlay.show_relationship_lines = False


class KARF_OT_import_capture(bpy.types.Operator):
    """Make a camera for every photo of a capture (transforms.json; its folder or camera file)"""

    bl_idname = "karf.import_capture"
    bl_label = "Import Capture"
    bl_options = {"REGISTER", "UNDO"}

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    project: StringProperty(name="Project", subtype="DIR_PATH", description="Empty: beside the .blend")
    filter_glob: StringProperty(default="*.json;*.npy;*.bin;*.txt", options={"HIDDEN"})

    def invoke(self, context, event):
        if self.filepath:  # a file was dropped
            return self.execute(context)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def draw(self, context):
        column = self.layout.column(align=True)
        for line in ("Choose the folder that has", "one of these, or the file:", *CAPTURE_MARKS):
            column.label(text=line)
        self.layout.prop(self, "project")

    @reports_errors
    def execute(self, context):
        project = Path(bpy.path.abspath(self.project)) if self.project else None
        capture = steps.import_capture(context.scene, Path(bpy.path.abspath(self.filepath)), project)
        for remark in capture.remarks:
            self.report({"WARNING"}, remark)
        if any(not view.camera.is_pinhole for view in capture.views):
            self.report({"WARNING"}, "The photos have lens distortion: backgrounds show them as they are stored")
        look_from_camera(context.area)
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
        look_from_camera(context.area)
        return {"FINISHED"}


class KARF_FH_capture(bpy.types.FileHandler):
    """Camera files may be dropped on the 3D View."""

    bl_idname = "KARF_FH_capture"
    bl_label = "KaRF capture"
    bl_import_operator = KARF_OT_import_capture.bl_idname
    bl_file_extensions = ".json;.npy"

    @classmethod
    def poll_drop(cls, context):
        return context.area is not None and context.area.type == "VIEW_3D"


CLASSES = (KARF_OT_import_capture, KARF_OT_look_through, KARF_FH_capture)
