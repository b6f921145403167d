"""Stopping the running job, and closing what is said of the last."""

import bpy

from .. import progress
from ..tasks import runner
from .reporting import reports_errors


class KARF_OT_cancel(bpy.types.Operator):
    """Stop the running job at its next safe point. Run the step again to resume it"""

    bl_idname = "karf.cancel"
    bl_label = "Cancel"

    @classmethod
    def poll(cls, context):
        if not runner.is_running():
            cls.poll_message_set("No job is running")
            return False
        return True

    @reports_errors
    def execute(self, context):
        runner.cancel()
        return {"FINISHED"}


class KARF_OT_dismiss(bpy.types.Operator):
    """Close this message"""

    bl_idname = "karf.dismiss"
    bl_label = "Dismiss"

    def execute(self, context):
        progress.dismiss()
        return {"FINISHED"}
