"""The engine: cancel its job, report a failed one; the preferences' buttons that test, install and remove it."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from .. import preferences, progress
from ..engine import failures, installing, probing
from ..engine.installer import computer, locks
from ..engine_api import ERROR, VERSION, DataError, KarfError, MissingDependency
from ..host import compat, windows
from ..host.words import draw_text, translatable
from ..project import folders
from ..steps import engine
from ..tasks import runner
from .base import IDLE, NOT_INSTALLING, StepOperator, need, reports_errors

LOG_NAME = "KaRF log"
FAILED_JOB = need("No job has failed", lambda context: context.window_manager.karf_progress.job)
BUILDS = {
    "auto": ("Automatic", "By the drivers that are on this computer"),
    "cpu": ("Processor", "The smallest download; works everywhere"),
    "cuda": ("NVIDIA", "CUDA: for NVIDIA cards"),
    "rocm": ("AMD", "ROCm: for AMD cards, on Linux"),
    "mps": ("Apple", "For Apple silicon"),
}
WIDTH, LETTERS = 640, 100  # of the dialog: width in pixels, and letters that fit into a line
SHELLS = {"posix": "Linux, macOS", "powershell": "PowerShell", "cmd": "Windows cmd"}


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


def versions() -> dict[str, str]:
    """Return the programs and their versions, for reports."""
    try:
        python = str(preferences.chosen_python())
    except MissingDependency as error:
        python = str(error)
    return {"KaRF": VERSION, "Blender": compat.BLENDER, "Engine Python": python}


class KARF_OT_install_engine(StepOperator, bpy.types.Operator):
    bl_description = (
        "Create a separate environment for the engine. A dialog first lists the downloads, their source "
        "and their folder. An existing environment is checked, completed, repaired or updated"
    )
    bl_idname = "karf.install_engine"
    bl_label = "Install Engine"
    needs = (NOT_INSTALLING, IDLE)

    build: EnumProperty(
        name="PyTorch for", items=[(name, *BUILDS[name]) for name in locks.BUILDS], options={"SKIP_SAVE"}
    )
    photos: BoolProperty(name="Find camera poses of photos (pycolmap)", options={"SKIP_SAVE"})
    folder: StringProperty(
        name="Folder", subtype="DIR_PATH", description="Folder to install to, new or empty", options={"SKIP_SAVE"}
    )
    wheels: StringProperty(
        name="Folder of wheels",
        subtype="DIR_PATH",
        description="Install from package files in this folder, without network",
    )
    starter: StringProperty(
        name="Python or uv", subtype="FILE_PATH",
        description="Python or uv that creates the environment. Empty: Blender's Python, uv, or any other one found",
    )  # fmt: skip

    def invoke(self, context, event):
        self.folder = self.folder or str(preferences.engine_folder())
        self.check(context)
        return context.window_manager.invoke_props_dialog(self, width=WIDTH, confirm_text="Install")

    def check(self, context):
        """Plan anew after each change; Blender calls it."""
        try:
            self.plan, self.error = self._plan(), None
        except KarfError as error:
            self.plan, self.error = None, error
        return True

    def draw(self, context):
        layout = self.layout
        row = layout.row(align=True)
        for name in ("auto", *computer.detect_machine().builds):
            row.prop_enum(self, "build", name)
        for name in ("photos", "folder", "wheels", "starter"):
            layout.prop(self, name)
        box = layout.box().column(align=True)
        if self.error:
            draw_text(box, self.error.sentence, "ERROR", LETTERS)
            draw_text(box, self.error.hint, "BLANK1", LETTERS)
            return
        for sentence in self.plan.sentences:
            draw_text(box, sentence, "DOT", LETTERS)
        row = layout.row(align=True)
        row.label(text="To do the same by hand:")
        for shell, label in SHELLS.items():
            copy = row.operator("karf.copy_command", text=label, icon="COPYDOWN")
            copy.command = self.plan.commands(shell)

    def step(self, context):
        planned = self._plan()
        engine.leave_python()
        if planned.folder != preferences.engine_folder():
            preferences.current().engine_folder = str(planned.folder)
            context.preferences.is_dirty = True
        installing.launch(planned)

    def _plan(self):
        paths = (bpy.path.abspath(path) for path in (self.folder, self.wheels, self.starter))
        return engine.plan_engine(self.build, ("photos",) if self.photos else (), *paths)


class KARF_OT_cancel_installation(StepOperator, bpy.types.Operator):
    """Stop installing. Downloaded files are kept"""

    bl_idname = "karf.cancel_installation"
    bl_label = "Cancel Installation"

    @classmethod
    def poll(cls, context):
        return installing.can_be_cancelled()

    def step(self, context):
        installing.cancel()


class KARF_OT_remove_engine(StepOperator, bpy.types.Operator):
    """Delete the engine's environment and everything downloaded for it. Projects stay"""

    bl_idname = "karf.remove_engine"
    bl_label = "Remove Engine"
    needs = (NOT_INSTALLING, IDLE)

    def invoke(self, context, event):
        message = f"{preferences.engine_folder()} will be deleted. Projects stay."
        return context.window_manager.invoke_confirm(
            self, event, title="Remove the engine?", message=message, confirm_text="Remove", icon="WARNING"
        )

    def step(self, context):
        engine.leave_python()
        installing.remove(preferences.engine_folder())
