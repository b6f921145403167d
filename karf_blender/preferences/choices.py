"""The user's choices: the Python that runs the engine, and the folder of the installed engine."""

import os
from pathlib import Path

import bpy

from ... import __package__ as extension
from .. import engine_api
from ..engine.installer import home
from ..engine_api import MissingDependency

VARIABLE = "KARF_ENGINE_PYTHON"


def current() -> bpy.types.AddonPreferences:
    """Return the preferences of this extension."""
    return bpy.context.preferences.addons[extension].preferences


def engine_folder() -> Path:
    """Return where the installed engine is, or would be: outside the extension, which updates replace."""
    chosen = current().engine_folder
    return Path(chosen) if chosen else Path(bpy.utils.extension_path_user(extension, path="engine"))


def chosen_python() -> Path:
    """Return the Python that runs the engine, there or not; never Blender's own.

    It is that of the preference, of the variable, of the installed engine, else of `.venv/engine` beside a checkout.

    Raises:
        MissingDependency: Its path is not absolute: what it names would depend on the open file.
    """
    chosen = _set_by_user()
    if not chosen:
        checkout = engine_api.ENGINE_FOLDER.parent / ".venv" / "engine"
        return home.python_in(engine_folder()) or home.python_of(checkout)
    # two slashes mean the .blend's folder, and a stranger's .blend may bring a program
    if chosen.startswith("//") or not Path(chosen).is_absolute():
        raise MissingDependency(
            "The engine's Python {python} is not an absolute path.",
            "Set it in the KaRF preferences, in the file browser with Relative Path off.",
            python=chosen,
        )
    return Path(chosen)


def engine_python() -> Path:
    """Return the Python that runs the engine.

    Raises:
        MissingDependency: None is known, or it does not exist.
    """
    python = chosen_python()
    if python.is_file():
        return python
    if _set_by_user():
        raise MissingDependency(
            "The engine's Python {python} does not exist.", "Set it in the KaRF preferences.", python=python
        )
    raise MissingDependency(
        "There is no engine yet.",
        "Press Install Engine in the KaRF preferences, or set Engine Python there to a Python that has PyTorch.",
    )


def has_engine() -> bool:
    """Tell whether a Python is there to run the engine."""
    try:
        return engine_python().is_file()
    except MissingDependency:
        return False


def _set_by_user() -> str:
    return current().engine_python or os.environ.get(VARIABLE, "")
