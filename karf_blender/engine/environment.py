"""The engine's Python: never Blender's own. Where it is; installs nothing itself. No bpy."""

import os
from collections.abc import Mapping
from pathlib import Path

from .. import engine_api
from ..engine_api import MissingDependency

VARIABLE = "KARF_ENGINE_PYTHON"


def chosen_python(preference: str, variables: Mapping[str, str], managed: Path | None = None) -> Path:
    """The engine's Python, there or not.

    Args:
        preference: What the user has set, which comes first.
        variables: The process's environment, of which KARF_ENGINE_PYTHON comes next.
        managed: The Python of the finished managed environment; without it that of `.venv/engine` beside the engine.

    Raises:
        MissingDependency: Its path is not absolute: what it names would depend on the open file.
    """
    chosen = preference or variables.get(VARIABLE, "")
    # two slashes stand for the .blend's folder, which may be a stranger's
    if chosen and (chosen.startswith("//") or not Path(chosen).is_absolute()):
        raise MissingDependency(
            "The engine's Python {python} is not an absolute path.",
            "Set it in the KaRF preferences, in the file browser with Relative Path off.",
            python=chosen,
        )
    if chosen:
        return Path(chosen)
    if managed is not None:
        return managed
    folder = engine_api.ENGINE_FOLDER.parent / ".venv" / "engine"
    return folder / "Scripts" / "python.exe" if os.name == "nt" else folder / "bin" / "python"


def find_python(preference: str, variables: Mapping[str, str], managed: Path | None = None) -> Path:
    """The chosen Python; arguments are those of `chosen_python`.

    Raises:
        MissingDependency: It is not a file, or not given by its whole path.
    """
    python = chosen_python(preference, variables, managed)
    if python.is_file():
        return python
    if preference or variables.get(VARIABLE):
        raise MissingDependency(
            "The engine's Python {python} does not exist.", "Set it in the KaRF preferences.", python=python
        )
    raise MissingDependency(
        "There is no engine yet.",
        "Press Install Engine in the KaRF preferences, or set Engine Python there to a Python that has PyTorch.",
    )
