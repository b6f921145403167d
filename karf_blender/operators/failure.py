"""What a failed job left: a report for others, and its log."""

from pathlib import Path

import bpy

from ..engine import failures, report
from ..engine_api import DataError
from ..host import windows
from .reporting import reports_errors, versions

LOG_NAME = "KaRF log"


class FailureStep:
    """Mix-in of operators that need a failed job."""

    @classmethod
    def poll(cls, context):
        if not context.window_manager.karf_progress.job:
            cls.poll_message_set("No job has failed")
            return False
        return True


class KARF_OT_copy_report(FailureStep, bpy.types.Operator):
    """Copy versions, the job's outcome and the end of its log, to send to a developer. Your names are left out"""

    bl_idname = "karf.copy_report"
    bl_label = "Copy Report"

    def execute(self, context):
        progress = context.window_manager.karf_progress
        context.window_manager.clipboard = report.compose(Path(progress.job), progress.error, versions())
        self.report({"INFO"}, "The report is on the clipboard")
        return {"FINISHED"}


class KARF_OT_open_log(FailureStep, bpy.types.Operator):
    """Open the end of the failed job's log in a Text Editor"""

    bl_idname = "karf.open_log"
    bl_label = "Open Log"

    @reports_errors
    def execute(self, context):
        job = Path(context.window_manager.karf_progress.job)
        tail = failures.log_tail(job)
        if not tail:
            raise DataError("The log in {job} is empty or missing.", "Run the step again.", job=job)
        windows.show_text(LOG_NAME, tail)
        return {"FINISHED"}
