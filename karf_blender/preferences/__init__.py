"""The user's settings of this machine: which Python runs the engine, and with how many threads."""

import os
from pathlib import Path

import bpy
from bpy.props import IntProperty, StringProperty

from ... import __package__ as extension
from ..engine import environment, installing, probing
from ..engine.managed import home
from ..engine_api import MissingDependency
from . import testing


class KARF_AP_preferences(bpy.types.AddonPreferences):
    """Preferences of the extension."""

    bl_idname = extension

    # a setting of this machine: unlike the scene's paths never relative to a .blend
    engine_python: StringProperty(
        name="Engine Python",
        subtype="FILE_PATH",
        description="The whole path of the Python that has PyTorch; empty: the variable KARF_ENGINE_PYTHON, else "
        ".venv/engine",
    )
    threads: IntProperty(
        name="Threads", min=0, max=256, description="Threads of the engine; 0: the engine chooses. Give free cores only"
    )

    def draw(self, context):
        layout = self.layout
        layout.prop(self, "engine_python")
        layout.prop(self, "threads")
        testing.draw_test(layout, self.engine_python)


def current() -> bpy.types.AddonPreferences:
    """The preferences of this extension."""
    return bpy.context.preferences.addons[extension].preferences


def engine_folder() -> Path:
    """Where the managed environment is, or would be made: outside the extension, which updates replace."""
    return Path(bpy.utils.extension_path_user(extension, path="engine"))


def chosen_python() -> Path:
    """The Python that runs the engine, there or not.

    Raises:
        MissingDependency: Its path is not absolute.
    """
    return environment.chosen_python(current().engine_python, os.environ, home.python_in(engine_folder()))


def engine_python() -> Path:
    """The Python that runs the engine.

    Raises:
        MissingDependency: None is known.
    """
    return environment.find_python(current().engine_python, os.environ, home.python_in(engine_folder()))


def has_engine() -> bool:
    """Whether a Python is there to run the engine."""
    try:
        return engine_python().is_file()
    except MissingDependency:
        return False


def register():
    """Called when the extension is enabled."""
    bpy.utils.register_class(KARF_AP_preferences)


def unregister():
    """Called when the extension is disabled."""
    installing.unregister()
    probing.cancel()
    bpy.utils.unregister_class(KARF_AP_preferences)
