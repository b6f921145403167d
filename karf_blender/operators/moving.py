"""The project moves beside the .blend, where the extension's own folder has it."""

import bpy

from .. import steps
from ..host import windows
from ..host.words import translate, translate_report
from ..project import moving
from .reporting import has_project, is_free, reports_errors


class KARF_OT_move_project(bpy.types.Operator):
    """Move the project from the extension's folder to the .blend's, to share both together. Saves the file"""

    bl_idname = "karf.move_project"
    bl_label = "Move Project Beside File"

    @classmethod
    def poll(cls, context):
        if not is_free(cls) or not has_project(cls, context):
            return False
        if not bpy.data.filepath or not moving.is_hidden(context.scene):
            cls.poll_message_set(
                "Save the file first" if not bpy.data.filepath else ("The project is beside the file already")
            )
            return False
        return True

    def invoke(self, context, event):
        self.place = str(moving.place_beside(context.scene))
        title = translate("Move the project beside the file?")
        return context.window_manager.invoke_props_dialog(self, width=420, title=title, confirm_text=translate("Move"))

    def draw(self, context):
        column = self.layout.column(align=True)
        column.label(text="The project is in the extension's own folder.")
        column.label(text="Beside the file, it is shared and backed up with it.")
        column.label(text=self.place, icon="FILE_FOLDER")

    def cancel(self, context):
        """Where it was refused it is not asked again; the button in step 1 stays."""
        context.scene.karf.stays_hidden = True

    @reports_errors
    def execute(self, context):
        place = steps.move_project(context.scene)
        windows.redraw(*windows.PANEL_AREAS)
        self.report({"INFO"}, translate_report("The project is in {path}", path=place))
        return {"FINISHED"}
