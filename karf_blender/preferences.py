"""The user's settings of this machine: which Python runs the engine, and with how many threads."""

import os
from pathlib import Path

import bpy
from bpy.props import IntProperty, StringProperty

from .. import __package__ as extension
from . import environment
from .compat import PATH_OPTIONS


class KARF_AP_preferences(bpy.types.AddonPreferences):
    """Preferences of the extension."""

    bl_idname = extension

    engine_python: StringProperty(
        name="Engine Python",
        subtype="FILE_PATH",
        options=PATH_OPTIONS,
        description="The Python that has PyTorch; empty: the variable KARF_ENGINE_PYTHON, else .venv/engine",
    )
    threads: IntProperty(
        name="Threads", min=0, max=256, description="Threads of the engine; 0: the engine chooses. Give free cores only"
    )
    examination: StringProperty(options={"HIDDEN", "SKIP_SAVE"})
    command: StringProperty(
        name="In a terminal", options={"SKIP_SAVE"}, description="Installs what is missing; copy it into a terminal"
    )

    def draw(self, context):
        layout = self.layout
        layout.prop(self, "engine_python")
        layout.prop(self, "threads")
        layout.operator("karf.examine_engine", icon="CHECKMARK")
        if self.examination:
            layout.label(text=self.examination, icon="ERROR" if self.command else "CHECKMARK")
        if self.command:
            layout.prop(self, "command")


def current() -> bpy.types.AddonPreferences:
    """The preferences of this extension."""
    return bpy.context.preferences.addons[extension].preferences


def engine_python() -> Path:
    """The Python that runs the engine. Raises MissingDependency where none is known."""
    return environment.find_python(bpy.path.abspath(current().engine_python), os.environ)


def register():
    """Called when the extension is enabled."""
    bpy.utils.register_class(KARF_AP_preferences)


def unregister():
    """Called when the extension is disabled."""
    bpy.utils.unregister_class(KARF_AP_preferences)
