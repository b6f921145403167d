"""The engine's Python: never Blender's own. Finds it and says what it lacks; installs nothing. No bpy."""

import json
import os
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from . import engine_api
from .engine_api import MissingDependency
from .jobs import child_environment

VARIABLE = "KARF_ENGINE_PYTHON"
PACKAGES = {
    "torch": "torch",
    "numpy": "numpy",
    "scipy": "scipy",
    "imageio": "imageio",
    "PIL": "pillow",
    "safetensors": "safetensors",
    "filelock": "filelock",
    "cv2": "opencv-python-headless",
    "OpenEXR": "OpenEXR",
}
TIMEOUT = 120.0
PROBE = """
import importlib.util, json, platform, sys
found = {name: importlib.util.find_spec(name) is not None for name in sys.argv[1:]}
facts = {"python": platform.python_version(), "missing": [name for name in found if not found[name]]}
if found["torch"]:
    import torch
    facts["torch"] = torch.__version__
    facts["device"] = torch.cuda.get_device_name() if torch.cuda.is_available() else "CPU"
print(json.dumps(facts))
"""


@dataclass(frozen=True)
class Examination:
    """What an engine Python is. missing: the packages to install into it."""

    python: Path
    version: str
    torch: str
    device: str
    missing: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """The verdict."""
        if self.missing:
            return f"Python {self.version} lacks {', '.join(self.missing)}"
        return f"Ready: Python {self.version}, torch {self.torch} on {self.device}"

    @property
    def command(self) -> str:
        """What to type into a terminal where packages are missing, else empty."""
        return f'"{self.python}" -m pip install {" ".join(self.missing)}' if self.missing else ""


def find_python(preference: str, variables: Mapping[str, str]) -> Path:
    """The Python of the preference, else of KARF_ENGINE_PYTHON, else of `.venv/engine` beside the engine.

    Raises MissingDependency where none is set, or where the one set is no file.
    """
    chosen = preference or variables.get(VARIABLE, "")
    if chosen and not Path(chosen).is_file():
        raise MissingDependency(f"The engine's Python {chosen} does not exist.", "Set it in the KaRF preferences.")
    if chosen:
        return Path(chosen)
    folder = engine_api.ENGINE_FOLDER.parent / ".venv" / "engine"
    beside = folder / "Scripts" / "python.exe" if os.name == "nt" else folder / "bin" / "python"
    if not beside.is_file():
        raise MissingDependency(
            "No Python with PyTorch is known to KaRF.", "Set Engine Python in the KaRF preferences to one that has it."
        )
    return beside


def examine(python: Path) -> Examination:
    """Ask a Python for its version, packages and device (a few seconds). Raises MissingDependency where it will not run."""
    try:
        done = subprocess.run(
            [str(python), "-I", "-c", PROBE, *PACKAGES],
            capture_output=True,
            text=True,
            timeout=TIMEOUT,
            env=child_environment(os.environ),
            stdin=subprocess.DEVNULL,
        )
        facts = json.loads(done.stdout.splitlines()[-1]) if done.returncode == 0 else None
    except (OSError, subprocess.TimeoutExpired, ValueError, IndexError) as error:
        raise MissingDependency(f"{python} does not run ({error}).", "Choose another Python.") from error
    if facts is None:
        reason = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise MissingDependency(f"{python} cannot load PyTorch: {reason}", "Install torch into it anew.")
    missing = tuple(PACKAGES[name] for name in facts["missing"])
    return Examination(python, facts["python"], facts.get("torch", ""), facts.get("device", ""), missing)
