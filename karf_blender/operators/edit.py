"""Step 6: swatches."""

from pathlib import Path

import bpy
from bpy.props import StringProperty

from .. import steps
from ..engine_api import EDIT_SUFFIXES
from ..host.words import translate_report
from ..swatches import becomes, edits
from .reporting import PreparedStep, ProjectSwatchStep, SwatchStep, reports_errors


class KARF_OT_becomes(ProjectSwatchStep, bpy.types.Operator):
    """Set the object's swatches so that the source color becomes the target color. Locked swatches stay"""

    bl_idname = "karf.becomes"
    bl_label = "Becomes"
    bl_options = {"REGISTER", "UNDO"}

    object_name: StringProperty(name="Object")

    @reports_errors
    def execute(self, context):
        remark = becomes.apply_picked(edits.object_named(context.scene, self.object_name))
        if remark:
            self.report({"WARNING"}, remark)
        return {"FINISHED"}


class KARF_OT_paint_over(PreparedStep, bpy.types.Operator):
    """Paint on a copy of the active view in the Image Editor, then match the swatches to it"""

    bl_idname = "karf.paint_over"
    bl_label = "Paint Over"
    bl_options = {"REGISTER", "UNDO"}

    @reports_errors
    def execute(self, context):
        steps.paint_over(context.scene)
        self.report({"INFO"}, "Paint on the objects in the Image Editor, then press Match Picture")
        return {"FINISHED"}


class KARF_OT_match_picture(PreparedStep, bpy.types.Operator):
    """Set the swatches so that the active view matches this edited picture of it. Locked swatches stay"""

    bl_idname = "karf.match_picture"
    bl_label = "Match Picture"
    bl_options = {"REGISTER", "UNDO"}

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})

    @reports_errors
    def execute(self, context):
        file = Path(bpy.path.abspath(self.filepath)) if self.filepath else None
        found = steps.match_picture(context.scene, file)
        left = ", ".join(f"{each.name} {each.before:.1f} before, {each.after:.1f} now" for each in found)
        self.report({"INFO"}, translate_report("Remaining difference from the picture: {left}", left=left))
        return {"FINISHED"}


class KARF_OT_load_edit(SwatchStep, bpy.types.Operator):
    """Set the swatches from an edit file, or from a palette of GIMP (.gpl) or Adobe (.ase)"""

    bl_idname = "karf.load_edit"
    bl_label = "Load Edit"
    bl_options = {"REGISTER", "UNDO"}

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: StringProperty(default=";".join(f"*{suffix}" for suffix in EDIT_SUFFIXES), options={"HIDDEN"})

    def invoke(self, context, event):
        if self.filepath:  # a file was dropped
            return self.execute(context)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    @reports_errors
    def execute(self, context):
        steps.apply_edit(context.scene, Path(bpy.path.abspath(self.filepath)))
        return {"FINISHED"}


class KARF_OT_save_edit(SwatchStep, bpy.types.Operator):
    """Write the swatches to an edit file for other scenes and scripts, or to a palette (.gpl, .ase)"""

    bl_idname = "karf.save_edit"
    bl_label = "Save Edit"

    filepath: StringProperty(subtype="FILE_PATH", default="edit.json")
    filter_glob: StringProperty(default=";".join(f"*{suffix}" for suffix in EDIT_SUFFIXES), options={"HIDDEN"})
    check_existing: bpy.props.BoolProperty(default=True, options={"HIDDEN"})

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    @reports_errors
    def execute(self, context):
        steps.save_edit(context.scene, Path(bpy.path.abspath(self.filepath)))
        self.report({"INFO"}, translate_report("Wrote {path}", path=self.filepath))
        return {"FINISHED"}


class KARF_FH_edit(bpy.types.FileHandler):
    """Load edit files dropped on the recolored picture"""

    bl_idname = "KARF_FH_edit"
    bl_label = "KaRF edit"
    bl_import_operator = KARF_OT_load_edit.bl_idname
    bl_file_extensions = ";".join(EDIT_SUFFIXES)

    @classmethod
    def poll_drop(cls, context):
        return context.area is not None and context.area.type == "IMAGE_EDITOR" and len(context.scene.karf.objects) > 0
