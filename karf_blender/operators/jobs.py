"""Cancel the running job, report a failed one, and the preferences' buttons that test the engine."""

from pathlib import Path

import bpy
from bpy.props import StringProperty

from .. import preferences, progress
from ..engine import failures, probing
from ..engine_api import ERROR, DataError
from ..host import windows
from ..host.words import translatable
from ..project import folders
from ..tasks import runner
from .base import NOT_INSTALLING, StepOperator, need, reports_errors, versions

LOG_NAME = "KaRF log"
FAILED_JOB = need("No job has failed", lambda context: context.window_manager.karf_progress.job)


class KARF_OT_cancel(StepOperator, bpy.types.Operator):
    """Stop the running job at its next safe point. Run the step again to resume it"""

    bl_idname = "karf.cancel"
    bl_label = "Cancel"
    needs = (need("No job is running", lambda context: runner.is_running()),)

    def step(self, context):
        runner.cancel()


class KARF_OT_dismiss(StepOperator, bpy.types.Operator):
    """Close this message"""

    bl_idname = "karf.dismiss"
    bl_label = "Dismiss"

    def step(self, context):
        progress.dismiss()


class KARF_OT_copy_report(StepOperator, bpy.types.Operator):
    """Copy versions, the job's outcome and the end of its log, to send to a developer. Your names are left out"""

    bl_idname = "karf.copy_report"
    bl_label = "Copy Report"
    needs = (FAILED_JOB,)

    def step(self, context):
        state = context.window_manager.karf_progress
        context.window_manager.clipboard = failures.compose(Path(state.job), state.error, versions())
        return translatable("The report is on the clipboard")


class KARF_OT_open_log(StepOperator, bpy.types.Operator):
    """Open the end of the failed job's log in a Text Editor"""

    bl_idname = "karf.open_log"
    bl_label = "Open Log"
    needs = (FAILED_JOB,)

    def step(self, context):
        job = Path(context.window_manager.karf_progress.job)
        tail = failures.log_tail(job)
        if not tail:
            raise DataError("The log in {job} is empty or missing.", "Run the step again.", job=job)
        windows.show_text(LOG_NAME, tail)


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
