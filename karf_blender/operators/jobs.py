"""Cancel the running job; report a failed one."""

from pathlib import Path

import bpy

from .. import progress
from ..engine import failures
from ..engine_api import DataError
from ..host import windows
from ..host.words import translatable
from ..tasks import runner
from .base import StepOperator, need, versions

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
