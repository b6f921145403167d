"""The user's settings of this machine: which Python runs the engine, how many threads, and how it is installed."""

import bpy
from bpy.props import IntProperty, StringProperty

from ... import __package__ as extension
from ..engine_api import Options, bounds_of
from ..host.words import draw_text
from . import color_book, managing, state
from .choices import chosen_python, current, engine_folder, engine_python, has_engine

__all__ = ["chosen_python", "color_book", "current", "engine_folder", "engine_python", "has_engine", "state"]


def _make_paths_absolute(preferences, _):
    # a setting of this machine must not depend on the file that is open
    for name in ("engine_folder", "color_book"):
        if getattr(preferences, name).startswith("//"):
            setattr(preferences, name, bpy.path.abspath(getattr(preferences, name)))
    color_book.refresh()


class KARF_AP_preferences(bpy.types.AddonPreferences):
    """Preferences of the extension."""

    bl_idname = extension

    # a setting of this machine: unlike the scene's paths never relative to a .blend
    engine_python: StringProperty(
        name="Engine Python",
        subtype="FILE_PATH",
        description="Absolute path of a Python with PyTorch, used instead of the installed engine. Empty: the "
        "variable KARF_ENGINE_PYTHON, or the installed engine",
    )
    engine_folder: StringProperty(
        name="Engine Folder",
        subtype="DIR_PATH",
        description="Folder for Install Engine. Empty: Blender's folder for this extension's files",
        update=_make_paths_absolute,
    )
    threads: IntProperty(
        name="Threads",
        min=0,
        max=bounds_of(Options, "threads")["max"],
        description="Number of engine threads, no more than free cores. 0: automatic",
    )
    marking_model: StringProperty(
        name="Marking Model",
        subtype="DIR_PATH",
        description="Absolute path of a folder with a Segment Anything model for boxes and clicks. Empty: boxes and "
        "clicks work without a model",
    )
    color_book: StringProperty(
        name="Color Book",
        subtype="FILE_PATH",
        description="Absolute path of a book of named colors: Adobe's .acb or .ase, GIMP's .gpl, or a .csv table. A "
        "swatch's menu shows the nearest names",
        update=_make_paths_absolute,
    )

    def draw(self, context):
        layout = self.layout
        managing.draw_engine(layout.box())
        for name in ("engine_python", "threads", "marking_model", "color_book"):
            layout.prop(self, name)
        if color_book.known().problem:
            draw_text(layout, color_book.known().problem, "ERROR", managing.WIDTH)
        managing.draw_test(layout)
