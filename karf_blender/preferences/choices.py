"""What the user has chosen: which Python runs the engine, and where the extension keeps one of its own."""

import os
from pathlib import Path

import bpy

from ... import __package__ as extension
from ..engine import environment
from ..engine.installer import home
from ..engine_api import MissingDependency


def current() -> bpy.types.AddonPreferences:
    """The preferences of this extension."""
    return bpy.context.preferences.addons[extension].preferences


def engine_folder() -> Path:
    """Where the managed environment is, or would be made: outside the extension, which updates replace."""
    chosen = current().engine_folder
    return Path(chosen) if chosen else Path(bpy.utils.extension_path_user(extension, path="engine"))


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
