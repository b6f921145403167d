"""The preferences' buttons: the test of the engine's Python, and its end."""

import bpy

from .. import preferences
from ..engine import probing
from .reporting import reports_errors


class KARF_OT_examine_engine(bpy.types.Operator):
    """Ask the engine's Python what it is and what it lacks"""

    bl_idname = "karf.examine_engine"
    bl_label = "Test Engine"

    @classmethod
    def poll(cls, context):
        if probing.is_running():
            cls.poll_message_set("A test is running")
            return False
        return True

    @reports_errors
    def execute(self, context):
        python = preferences.chosen_python()
        probing.launch(python)
        verdict = probing.verdict_on(python)
        if verdict is None:  # it is still being asked; the preferences show its answer
            return {"FINISHED"}
        self.report({"INFO" if verdict.is_ready else "ERROR"}, f"{verdict.sentence}. {verdict.command}".strip())
        return {"FINISHED"} if verdict.is_ready else {"CANCELLED"}


class KARF_OT_cancel_examination(bpy.types.Operator):
    """Stop asking the engine's Python"""

    bl_idname = "karf.cancel_examination"
    bl_label = "Cancel Test"

    def execute(self, context):
        probing.cancel()
        return {"FINISHED"}


CLASSES = (KARF_OT_examine_engine, KARF_OT_cancel_examination)
