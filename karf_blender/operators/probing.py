"""The preferences' buttons: the test of the engine's Python, its end, and what it found for others to read."""

import bpy
from bpy.props import StringProperty

from .. import preferences
from ..engine import failures, probing
from ..engine_api import ERROR
from ..project import folders
from .base import NOT_INSTALLING, is_met, reports_errors, versions


class KARF_OT_examine_engine(bpy.types.Operator):
    """Check the engine's Python packages, device and disk space, and run each stage on a tiny scene"""

    bl_idname = "karf.examine_engine"
    bl_label = "Test Engine"

    @classmethod
    def poll(cls, context):
        if probing.is_running():
            cls.poll_message_set("A test is running")
            return False
        if not is_met(cls, context, NOT_INSTALLING):
            return False
        if problem := preferences.state.known().problem:
            cls.poll_message_set(problem)
            return False
        return True

    @reports_errors
    def execute(self, context):
        python = preferences.chosen_python()
        probing.launch(python, folders.likely_project(context.scene), preferences.current().threads)
        verdict = probing.verdict_on(python)
        if verdict is None:  # it is still being asked; the preferences show its answer
            return {"FINISHED"}
        self.report({"ERROR" if verdict.status == ERROR else "INFO"}, " ".join(verdict.lines))
        return {"CANCELLED"} if verdict.status == ERROR else {"FINISHED"}


class KARF_OT_cancel_examination(bpy.types.Operator):
    """Stop the test"""

    bl_idname = "karf.cancel_examination"
    bl_label = "Cancel Test"

    def execute(self, context):
        probing.cancel()
        return {"FINISHED"}


class KARF_OT_copy_findings(bpy.types.Operator):
    """Copy versions and all test results, to send to a developer. Your names are left out"""

    bl_idname = "karf.copy_findings"
    bl_label = "Copy Report"

    @classmethod
    def poll(cls, context):
        if not _findings():
            cls.poll_message_set("Test the engine first")
            return False
        return True

    def execute(self, context):
        context.window_manager.clipboard = failures.compose_findings(_findings(), versions())
        self.report({"INFO"}, "The report is on the clipboard")
        return {"FINISHED"}


class KARF_OT_copy_command(bpy.types.Operator):
    """Copy this command to paste it into a terminal"""

    bl_idname = "karf.copy_command"
    bl_label = "Copy Command"

    command: StringProperty(name="Command")

    def execute(self, context):
        context.window_manager.clipboard = self.command
        self.report({"INFO"}, "The command is on the clipboard")
        return {"FINISHED"}


def _findings():
    return probing.findings_on(preferences.state.known().python)  # polls never read the disk
