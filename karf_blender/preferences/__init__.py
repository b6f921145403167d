"""The user's settings of this machine: which Python runs the engine, how many threads, and how it is installed."""

import bpy
from bpy.props import IntProperty, StringProperty

from ... import __package__ as extension
from ..engine import installing, probing, removing
from ..engine_api import Options, bounds_of
from . import managing, state, testing
from .choices import chosen_python, current, engine_folder, engine_python, has_engine

__all__ = ["chosen_python", "current", "engine_folder", "engine_python", "has_engine", "state"]


def _make_whole(preferences, _):
    # a setting of this machine must not depend on the file that is open
    if preferences.engine_folder.startswith("//"):
        preferences.engine_folder = bpy.path.abspath(preferences.engine_folder)


class KARF_AP_preferences(bpy.types.AddonPreferences):
    """Preferences of the extension."""

    bl_idname = extension

    # a setting of this machine: unlike the scene's paths never relative to a .blend
    engine_python: StringProperty(
        name="Engine Python",
        subtype="FILE_PATH",
        description="The whole path of a Python that has PyTorch, in place of the installed engine; empty: the variable "
        "KARF_ENGINE_PYTHON, else the installed engine",
    )
    engine_folder: StringProperty(
        name="Engine Folder",
        subtype="DIR_PATH",
        description="Where Install Engine puts the engine; empty: Blender's folder for this extension's own files",
        update=_make_whole,
    )
    threads: IntProperty(
        name="Threads",
        min=0,
        max=bounds_of(Options, "threads")["max"],
        description="Threads of the engine; 0: the engine chooses. Give free cores only",
    )
    marking_model: StringProperty(
        name="Marking Model",
        subtype="DIR_PATH",
        description="The whole path of a folder with a model of the Segment Anything family, which then answers boxes and "
        "clicks; empty: they need none",
    )

    def draw(self, context):
        layout = self.layout
        managing.draw_engine(layout.box())
        layout.prop(self, "engine_python")
        layout.prop(self, "threads")
        layout.prop(self, "marking_model")
        testing.draw_test(layout)


def register():
    """Called when the extension is enabled."""
    bpy.utils.register_class(KARF_AP_preferences)


def unregister():
    """Called when the extension is disabled."""
    installing.unregister()
    removing.unregister()
    state.unregister()
    probing.cancel()
    bpy.utils.unregister_class(KARF_AP_preferences)
