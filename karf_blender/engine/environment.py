"""The engine's Python: never Blender's own. Where it is; installs nothing. No bpy."""

import os
from collections.abc import Mapping
from pathlib import Path

from .. import engine_api
from ..engine_api import MissingDependency

VARIABLE = "KARF_ENGINE_PYTHON"


def chosen_python(preference: str, variables: Mapping[str, str]) -> Path:
    """The Python of the preference, else of KARF_ENGINE_PYTHON, else of `.venv/engine` beside the engine; there or not.

    Raises:
        MissingDependency: Its path is not absolute: what it names would depend on the open file.
    """
    chosen = preference or variables.get(VARIABLE, "")
    # two slashes stand for the .blend's folder, which may be a stranger's
    if chosen and (chosen.startswith("//") or not Path(chosen).is_absolute()):
        raise MissingDependency(
            f"The engine's Python {chosen} is not given by its whole path.",
            "Set it in the KaRF preferences, in the file browser with Relative Path off.",
        )
    if chosen:
        return Path(chosen)
    folder = engine_api.ENGINE_FOLDER.parent / ".venv" / "engine"
    return folder / "Scripts" / "python.exe" if os.name == "nt" else folder / "bin" / "python"


def find_python(preference: str, variables: Mapping[str, str]) -> Path:
    """The chosen Python.

    Raises:
        MissingDependency: It is no file, or not given by its whole path.
    """
    python = chosen_python(preference, variables)
    if python.is_file():
        return python
    if preference or variables.get(VARIABLE):
        raise MissingDependency(f"The engine's Python {python} does not exist.", "Set it in the KaRF preferences.")
    raise MissingDependency(
        "No Python with PyTorch is known to KaRF.", "Set Engine Python in the KaRF preferences to one that has it."
    )
