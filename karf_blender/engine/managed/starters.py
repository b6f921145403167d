"""The program that makes the environment: a Python that can, or uv. No bpy."""

import json
import os
import re
import shutil
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ...engine_api import MissingDependency
from .. import processes

PROBE_SECONDS = 20.0
PROBE = """
import importlib.util, json, platform, struct, sys
can = importlib.util.find_spec("ensurepip") is not None and importlib.util.find_spec("venv") is not None
version = "{}.{}".format(*sys.version_info)
print(json.dumps({"version": version, "can": can, "bits": struct.calcsize("P") * 8}))
"""
UNIX_FOLDERS = ("/usr/local/bin", "/usr/bin", "/opt/homebrew/bin", "~/.local/bin")


@dataclass(frozen=True)
class Starter:
    """What makes the environment. python: its interpreter; empty: uv brings one. uv: empty where Python itself can."""

    python: str
    version: str
    uv: str = ""

    @property
    def sentence(self) -> str:
        """How the environment is made."""
        if not self.uv:
            return f"made by {self.python} (Python {self.version})"
        return f"made by {self.uv} with {self.python or 'a Python that it finds or fetches'} (Python {self.version})"


def find(chosen: str, own_python: str, wanted: Sequence[str], variables: Mapping[str, str]) -> Starter:
    """Find what can make the environment: the chosen one, Blender's own Python, uv, any other Python.

    Args:
        chosen: Path of a Python or of uv; empty: the first found.
        own_python: Blender's own Python.
        wanted: The Pythons that have a recipe, oldest first.
        variables: The process's environment.

    Raises:
        MissingDependency: None can; says what was tried.
    """
    tried: list[str] = []
    if chosen:
        starter = _chosen(chosen, own_python, wanted, tried)
    else:
        others = _pythons(own_python, wanted, variables)
        starter = (
            _by_python(own_python, wanted, tried)
            or _by_uv(shutil.which("uv", path=_path(variables)), own_python, wanted, tried)
            or next(filter(None, (_by_python(path, wanted, tried) for path in others)), None)
        )
    if starter is None:
        raise MissingDependency(
            f"Nothing here can make a Python environment. Tried: {'; '.join(tried)}.",
            f"Install Python {wanted[0]} to {wanted[-1]} with venv (Debian and Ubuntu: python3-venv), or uv.",
        )
    return starter


def _chosen(chosen: str, own_python: str, wanted: Sequence[str], tried: list[str]) -> Starter | None:
    if Path(chosen).stem.lower() == "uv":
        return _by_uv(chosen, own_python, wanted, tried)
    return _by_python(chosen, wanted, tried)


def _by_python(path: str, wanted: Sequence[str], tried: list[str]) -> Starter | None:
    found = _ask(path)
    if isinstance(found, str):
        tried.append(f"{path} ({found})")
    elif found["version"] not in wanted or found["bits"] != 64:
        tried.append(f"{path} (Python {found['version']} of {found['bits']} bits)")
    elif not found["can"]:
        tried.append(f"{path} (has no venv and ensurepip)")
    else:
        return Starter(path, found["version"])
    return None


def _by_uv(uv: str | None, own_python: str, wanted: Sequence[str], tried: list[str]) -> Starter | None:
    """An environment of uv's needs no ensurepip: Blender's own Python will do."""
    if uv is None:
        tried.append("uv (not on the PATH)")
        return None
    if not Path(uv).is_file():
        tried.append(f"{uv} (does not exist)")
        return None
    found = _ask(own_python)
    if not isinstance(found, str) and found["version"] in wanted:
        return Starter(own_python, found["version"], uv)
    return Starter("", wanted[-2] if len(wanted) > 1 else wanted[0], uv)


def _ask(python: str) -> dict | str:
    """What a Python says of itself, or why it says nothing."""
    try:
        return json.loads(_said([python, "-I", "-c", PROBE]))
    except ValueError:
        return "is not a Python that answers" if Path(python).exists() else "does not exist"


def _said(command: Sequence[str]) -> str:
    """What a program says within some seconds; nothing where it does not start or end."""
    options = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    try:
        process = processes.start(command, **options)
    except OSError:
        return ""
    try:
        said, _ = process.communicate(timeout=PROBE_SECONDS)
    except subprocess.TimeoutExpired:
        processes.end(process)
        return ""
    return said.decode("utf-8", "replace")


def listed(said: str) -> list[str]:
    """The paths in what Windows' launcher lists of Pythons (`py -0p`).

    Examples:
        >>> listed(" -V:3.12 *        C:\\\\Program Files\\\\Python312\\\\python.exe\\nNo more.")
        ['C:\\\\Program Files\\\\Python312\\\\python.exe']
    """
    return re.findall(r"\s([A-Za-z]:\\.*python\.exe)\s*$", said, re.MULTILINE | re.IGNORECASE)


def _pythons(own_python: str, wanted: Sequence[str], variables: Mapping[str, str]) -> Iterator[str]:
    """Other Pythons of this computer, newest first of those that have a recipe, each once."""
    seen = {os.path.realpath(own_python)}
    for path in _candidates(wanted[::-1], variables):
        real = os.path.realpath(path)
        if real not in seen:
            seen.add(real)
            yield str(path)


def _candidates(newest_first: Sequence[str], variables: Mapping[str, str]) -> Iterator[Path]:
    path = _path(variables)
    names = [*(f"python{version}" for version in newest_first), "python3", "python"]
    yield from (Path(found) for name in names if (found := shutil.which(name, path=path)))
    if os.name == "nt":
        yield from map(Path, listed(_said([shutil.which("py", path=path) or "py", "-0p"])))
        for version in newest_first:
            short = version.replace(".", "")
            for variable, folder in (
                ("LOCALAPPDATA", rf"Programs\Python\Python{short}"),
                ("ProgramFiles", f"Python{short}"),
                ("SystemDrive", rf"\Python{short}"),
            ):
                python = Path(f"{variables.get(variable, '')}/{folder}/python.exe")
                if variable in variables and python.is_file():
                    yield python


def _path(variables: Mapping[str, str]) -> str:
    """The PATH; programs started from a desktop often lack folders of it that terminals have."""
    folders = variables.get("PATH", "").split(os.pathsep)
    if os.name != "nt":
        folders += [str(Path(folder).expanduser()) for folder in UNIX_FOLDERS]
        folders.append("/Library/Frameworks/Python.framework/Versions/Current/bin")
    return os.pathsep.join(filter(None, folders))
