"""The user's settings of this machine: which Python runs the engine, how many threads, and how it is installed."""

import bpy
from bpy.props import IntProperty, StringProperty

from ... import __package__ as extension
from ..engine_api import Options, bounds_of
from ..host.labels import draw_text
from . import color_book, managing, state, testing
from .choices import chosen_python, current, engine_folder, engine_python, has_engine

__all__ = ["chosen_python", "color_book", "current", "engine_folder", "engine_python", "has_engine", "state"]


def _make_whole(preferences, _):
    # a setting of this machine must not depend on the file that is open
    if preferences.engine_folder.startswith("//"):
        preferences.engine_folder = bpy.path.abspath(preferences.engine_folder)


def _make_book_whole(preferences, _):
    if preferences.color_book.startswith("//"):
        preferences.color_book = bpy.path.abspath(preferences.color_book)
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
        update=_make_whole,
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
        update=_make_book_whole,
    )

    def draw(self, context):
        layout = self.layout
        managing.draw_engine(layout.box())
        layout.prop(self, "engine_python")
        layout.prop(self, "threads")
        layout.prop(self, "marking_model")
        layout.prop(self, "color_book")
        if color_book.known().problem:
            draw_text(layout, color_book.known().problem, "ERROR", testing.WIDTH)
        testing.draw_test(layout)
