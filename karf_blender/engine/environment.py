"""The engine's Python: never Blender's own. Finds it and says what it lacks; installs nothing itself. No bpy."""

import json
import os
import subprocess
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from .. import engine_api
from ..engine_api import MissingDependency
from . import processes

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
TIMEOUT = 120.0  # a first import of torch from a cold disk is slow
WAIT_SECONDS = 0.05
PROBE = """
import importlib.util, json, platform, sys
found = {name: importlib.util.find_spec(name) is not None for name in sys.argv[1:]}
summary = {"python": platform.python_version(), "missing": [name for name in found if not found[name]]}
if found["torch"]:
    import torch
    summary["torch"] = torch.__version__
    summary["device"] = torch.cuda.get_device_name() if torch.cuda.is_available() else "CPU"
print(json.dumps(summary))
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
            f"The engine's Python {chosen} is not given by its whole path.",
            "Set it in the KaRF preferences, in the file browser with Relative Path off.",
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
        MissingDependency: It is no file, or not given by its whole path.
    """
    python = chosen_python(preference, variables, managed)
    if python.is_file():
        return python
    if preference or variables.get(VARIABLE):
        raise MissingDependency(f"The engine's Python {python} does not exist.", "Set it in the KaRF preferences.")
    raise MissingDependency(
        "No Python with PyTorch is known to KaRF.",
        "Press Install Engine in the KaRF preferences, or set Engine Python to one that has it.",
    )


class Probe:
    """A question to a Python for its version, packages and device (a few seconds): `poll` it until it has answered.

    Raises:
        MissingDependency: The Python cannot be started.
    """

    def __init__(self, python: Path) -> None:
        self.python = python
        self._end_by = time.monotonic() + TIMEOUT
        # files take any amount of words; a pipe that nobody reads would hold the child up
        self._said, self._errors = tempfile.TemporaryFile(), tempfile.TemporaryFile()
        command = [str(python), "-I", "-X", "utf8", "-c", PROBE, *PACKAGES]
        try:
            self._process = processes.start(command, stdin=subprocess.DEVNULL, stdout=self._said, stderr=self._errors)
        except OSError as error:
            raise _does_not_run(python, error) from error

    def poll(self) -> Examination | None:
        """The answer, or None while there is none yet. Never blocks.

        Raises:
            MissingDependency: The Python does not run, or does not answer in time.
        """
        code = self._process.poll()
        if code is None and time.monotonic() > self._end_by:
            self.end()
            raise _does_not_run(self.python, f"no answer in {TIMEOUT:.0f} seconds")
        return None if code is None else self._answer(code)

    def end(self) -> None:
        """End the Python where it still runs."""
        processes.end(self._process)

    def _answer(self, code: int) -> Examination:
        if code:
            reason = (_lines(self._errors) or [processes.ending(self._process)])[-1]
            raise MissingDependency(f"{self.python} cannot load PyTorch: {reason}", "Install torch into it anew.")
        try:
            summary = json.loads(_lines(self._said)[-1])
            missing = tuple(PACKAGES[name] for name in summary["missing"])
            return Examination(
                self.python, summary["python"], summary.get("torch", ""), summary.get("device", ""), missing
            )
        except (ValueError, LookupError, TypeError) as error:
            raise _does_not_run(self.python, error) from error


def _lines(stream: IO[bytes]) -> list[str]:
    stream.seek(0)
    return stream.read().decode("utf-8", "replace").strip().splitlines()


def _does_not_run(python: Path, reason: object) -> MissingDependency:
    return MissingDependency(f"{python} does not run as a Python ({reason}).", "Choose another Python.")


def examine(python: Path) -> Examination:
    """Ask a Python and block until it has answered.

    Raises:
        MissingDependency: It does not run.
    """
    probe = Probe(python)
    try:
        while (found := probe.poll()) is None:
            time.sleep(WAIT_SECONDS)
    finally:
        probe.end()
    return found
