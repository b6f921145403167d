"""Camera animations to files and back, for renderers of radiance fields and other programs."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, StringProperty

from .. import progress, steps
from ..host.words import translate_report
from .capture import view_from_camera
from .reporting import reports_errors


class KARF_OT_export_cameras(bpy.types.Operator):
    """Write the scene's camera at every frame of the scene to a transforms.json, relative to the rig"""

    bl_idname = "karf.export_cameras"
    bl_label = "Export Cameras"

    filepath: StringProperty(subtype="FILE_PATH", default="cameras.json")
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})
    check_existing: BoolProperty(default=True, options={"HIDDEN"})

    @classmethod
    def poll(cls, context):
        if context.scene.camera is None:
            cls.poll_message_set("The scene has no camera")
            return False
        return True

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    @reports_errors
    def execute(self, context):
        scene, path = context.scene, Path(bpy.path.abspath(self.filepath))
        progress.wrote(steps.export_cameras(scene, path).parent)
        count = len(steps.frame_range(scene))
        self.report({"INFO"}, translate_report("Wrote {count} cameras to {path}", count=count, path=path))
        return {"FINISHED"}


class KARF_OT_import_cameras(bpy.types.Operator):
    """Create one animated camera from the cameras in a transforms.json, one frame for each"""

    bl_idname = "karf.import_cameras"
    bl_label = "Import Cameras"
    bl_options = {"REGISTER", "UNDO"}

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    @reports_errors
    def execute(self, context):
        camera = steps.import_cameras(context.scene, Path(bpy.path.abspath(self.filepath)))
        view_from_camera(context.area)
        self.report({"INFO"}, translate_report("{name} is now the scene's camera", name=camera.name))
        return {"FINISHED"}
