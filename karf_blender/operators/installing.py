"""The preferences' buttons: the engine installed, repaired or updated, all by one dialog; cancelled; removed."""

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from .. import preferences
from ..engine import installing
from ..engine.installer import computer, locks
from ..engine_api import KarfError
from ..host.words import draw_text
from ..steps import engine
from .base import IDLE, NOT_INSTALLING, is_met, reports_errors

BUILDS = {
    "auto": ("Automatic", "By the drivers that are on this computer"),
    "cpu": ("Processor", "The smallest download; works everywhere"),
    "cuda": ("NVIDIA", "CUDA: for NVIDIA cards"),
    "rocm": ("AMD", "ROCm: for AMD cards, on Linux"),
    "mps": ("Apple", "For Apple silicon"),
}
WIDTH, LETTERS = 640, 100  # of the dialog: width in pixels, and letters that fit into a line
SHELLS = {"posix": "Linux, macOS", "powershell": "PowerShell", "cmd": "Windows cmd"}


class KARF_OT_install_engine(bpy.types.Operator):
    bl_description = (
        "Create a separate environment for the engine. A dialog first lists the downloads, their source "
        "and their folder. An existing environment is checked, completed, repaired or updated"
    )

    bl_idname = "karf.install_engine"
    bl_label = "Install Engine"

    build: EnumProperty(
        name="PyTorch for", items=[(name, *BUILDS[name]) for name in locks.BUILDS], options={"SKIP_SAVE"}
    )
    photos: BoolProperty(name="Find camera poses of photos (pycolmap)", options={"SKIP_SAVE"})
    folder: StringProperty(
        name="Folder",
        subtype="DIR_PATH",
        description="Folder to install to, new or empty",
        options={"SKIP_SAVE"},
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

    @classmethod
    def poll(cls, context):
        return is_met(cls, context, NOT_INSTALLING, IDLE)

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

    @reports_errors
    def execute(self, context):
        planned = self._plan()
        engine.leave_python()
        if planned.folder != preferences.engine_folder():
            preferences.current().engine_folder = str(planned.folder)
            context.preferences.is_dirty = True
        installing.launch(planned)
        return {"FINISHED"}

    def _plan(self):
        paths = (bpy.path.abspath(path) for path in (self.folder, self.wheels, self.starter))
        return engine.plan_engine(self.build, ("photos",) if self.photos else (), *paths)


class KARF_OT_cancel_installation(bpy.types.Operator):
    """Stop installing. Downloaded files are kept"""

    bl_idname = "karf.cancel_installation"
    bl_label = "Cancel Installation"

    @classmethod
    def poll(cls, context):
        return installing.can_be_cancelled()

    @reports_errors
    def execute(self, context):
        installing.cancel()
        return {"FINISHED"}


class KARF_OT_remove_engine(bpy.types.Operator):
    """Delete the engine's environment and everything downloaded for it. Projects stay"""

    bl_idname = "karf.remove_engine"
    bl_label = "Remove Engine"

    @classmethod
    def poll(cls, context):
        return is_met(cls, context, NOT_INSTALLING, IDLE)

    def invoke(self, context, event):
        message = f"{preferences.engine_folder()} will be deleted. Projects stay."
        return context.window_manager.invoke_confirm(
            self, event, title="Remove the engine?", message=message, confirm_text="Remove", icon="WARNING"
        )

    @reports_errors
    def execute(self, context):
        engine.leave_python()
        installing.remove(preferences.engine_folder())
        return {"FINISHED"}
