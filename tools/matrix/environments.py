"""Environments of cells, made by uv under .venv/matrix/. Nothing but uv and the standard library."""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from .. import dev
from .cells import ROOT, Cell

FOLDER = ROOT / ".venv" / "matrix"


class Unavailable(Exception):
    """A cell cannot be run here and now, which is no fault of the program: an interpreter or the network is missing."""


class Unresolvable(Exception):
    """No versions of the packages go together on this Python."""


@dataclass(frozen=True)
class Environment:
    """What a cell runs in. lock: its packages, `name==version` in each line."""

    python: Path
    lock: str

    @property
    def versions(self) -> dict[str, str]:
        """Package -> version."""
        return dict(line.split("==") for line in self.lock.splitlines())


def find_python(version: str) -> Path:
    """The interpreter of a version, as 3.12; pyenv's are found without being chosen in pyenv.

    Raises:
        Unavailable: There is none here.
    """
    pyenv = sorted(Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")).glob(f"versions/{version}.*/bin"))
    path = os.pathsep.join([*map(str, pyenv), os.environ["PATH"]])
    found = _uv("python", "find", "--system", "--no-python-downloads", version, PATH=path)
    if found.returncode:
        raise Unavailable(f"Python {version} is not installed here")
    return Path(found.stdout.strip())


def make(cell: Cell) -> Environment:
    """The environment of a cell, kept from an earlier run where its packages are still the right ones.

    Raises:
        Unavailable: The interpreter is missing, or the packages cannot be had.
        Unresolvable: No versions go together.
    """
    base = find_python(cell.python)
    lock = resolve(cell, base)
    folder = FOLDER / cell.name
    python = dev.python_of(f"matrix/{cell.name}")
    mark = folder / "made-from.txt"
    if not mark.exists() or mark.read_text(encoding="utf-8") != lock:
        _install(base, folder, python, lock)
        mark.write_text(lock, encoding="utf-8")
    return Environment(python, lock)


def resolve(cell: Cell, base: Path, platform: str = "", macos: str = "") -> str:
    """The versions that the cell's ranges mean today: `name==version` in each line. Only wheels: nothing is compiled.

    Args:
        cell: Whose ranges.
        base: An interpreter; of the cell's version, or of any where a platform is given.
        platform: Another system than this one, as uv calls it.
        macos: The oldest macOS that may be needed, as 14.0.

    Raises:
        Unavailable: The index does not answer.
        Unresolvable: No versions go together.
    """
    options = ["--only-binary", ":all:", "--no-header", "--no-annotate", "--no-emit-options", "--quiet"]
    wanted = "\n".join(cell.requirements)
    options += ["--python", str(base), "--resolution", cell.resolution]
    options += ["--python-platform", platform, "--python-version", cell.python] if platform else []
    variables = {"MACOSX_DEPLOYMENT_TARGET": macos} if macos else {}
    done = _uv("pip", "compile", "-", *options, input=wanted, **variables)
    if done.returncode == 0:
        return done.stdout
    print(done.stderr.strip(), flush=True)
    if "No solution found" in done.stderr:
        raise Unresolvable(f"no versions of {', '.join(cell.packages)} go together on Python {cell.python}")
    raise Unavailable("which versions there are could not be asked")


def clean() -> None:
    """Remove the environments of all cells."""
    shutil.rmtree(FOLDER, ignore_errors=True)


def _install(base: Path, folder: Path, python: Path, lock: str) -> None:
    commands = [
        ("venv", "--clear", "--quiet", "--seed", "--python", str(base), str(folder)),
        ("pip", "install", "--quiet", "--python", str(python), "--requirement", "-"),
    ]
    for command in commands:
        done = _uv(*command, input=lock)
        if done.returncode:
            print(done.stderr.strip(), flush=True)
            raise Unavailable("the packages could not be downloaded or installed")


def _uv(*arguments: str, input: str | None = None, **variables: str) -> subprocess.CompletedProcess:
    """Run uv: the one on the search path, or that of the environment that this runs in."""
    uv = shutil.which("uv") or _own_uv()
    return subprocess.run(
        [uv, *arguments], env=os.environ | variables, input=input, capture_output=True, text=True, encoding="utf-8"
    )


def _own_uv() -> str:
    from uv import find_uv_bin

    return find_uv_bin()
