"""The preferences' buttons: the test of the engine's Python, its end, and what it found for others to read."""

import bpy
from bpy.props import StringProperty

from .. import preferences
from ..engine import failures, probing
from ..engine_api import ERROR
from ..host.words import translatable
from ..project import folders
from .base import NOT_INSTALLING, StepOperator, need, reports_errors, versions


class KARF_OT_examine_engine(StepOperator, bpy.types.Operator):
    """Check the engine's Python packages, device and disk space, and run each stage on a tiny scene"""

    bl_idname = "karf.examine_engine"
    bl_label = "Test Engine"
    needs = (
        need("A test is running", lambda context: not probing.is_running()),
        NOT_INSTALLING,
        lambda context: preferences.state.known().problem,
    )

    @reports_errors
    def execute(self, context):
        python = preferences.chosen_python()
        probing.launch(python, folders.likely_project(context.scene), preferences.current().threads)
        verdict = probing.verdict_on(python)
        if verdict is None:  # it is still being asked; the preferences show its answer
            return {"FINISHED"}
        self.report({"ERROR" if verdict.status == ERROR else "INFO"}, " ".join(verdict.lines))
        return {"CANCELLED"} if verdict.status == ERROR else {"FINISHED"}


class KARF_OT_cancel_examination(StepOperator, bpy.types.Operator):
    """Stop the test"""

    bl_idname = "karf.cancel_examination"
    bl_label = "Cancel Test"

    def step(self, context):
        probing.cancel()


class KARF_OT_copy_findings(StepOperator, bpy.types.Operator):
    """Copy versions and all test results, to send to a developer. Your names are left out"""

    bl_idname = "karf.copy_findings"
    bl_label = "Copy Report"
    needs = (need("Test the engine first", lambda context: _findings()),)

    def step(self, context):
        context.window_manager.clipboard = failures.compose_findings(_findings(), versions())
        return translatable("The report is on the clipboard")


class KARF_OT_copy_command(StepOperator, bpy.types.Operator):
    """Copy this command to paste it into a terminal"""

    bl_idname = "karf.copy_command"
    bl_label = "Copy Command"

    command: StringProperty(name="Command")

    def step(self, context):
        context.window_manager.clipboard = self.command
        return translatable("The command is on the clipboard")


def _findings():
    return probing.findings_on(preferences.state.known().python)  # polls never read the disk
