"""The cells of the matrix: which tests run on which Blender or Python, with which packages, and how uv installs these.

noxfile.py runs them. Ranges of packages are those of pyproject.toml. Nothing but uv and the standard library.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
WHEEL_TEST = ["setuptools>=77", "packaging>=24.2"]  # with which a test builds the engine's wheel and looks into it
PICTURES = ["imageio"]  # with which tests of the extension look at what it wrote
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
# Blender as a module, and the numpy that Blender itself brings with that version
BLENDERS = {
    "addon-4.2": ("3.11", ["bpy>=4.2,<4.3", "numpy>=1.24.3,<1.25"]),
    "addon-4.5": ("3.11", ["bpy>=4.5,<4.6", "numpy>=1.26,<2"]),
    "addon-5.0": ("3.11", ["bpy>=5.0,<5.1", "numpy>=1.26,<2"]),
    "addon-5.1": ("3.13", ["bpy>=5.1,<5.2", "numpy>=2"]),
    "addon-newest-3.11": ("3.11", ["bpy", "numpy"]),
    "addon-newest-3.13": ("3.13", ["bpy", "numpy"]),
}
PLATFORMS = {  # as uv calls them
    "Linux (glibc 2.28), x86-64": "x86_64-manylinux_2_28",
    "Linux (glibc 2.28), ARM": "aarch64-manylinux_2_28",
    "Windows, x86-64": "x86_64-pc-windows-msvc",
    "macOS 14, Apple silicon": "aarch64-apple-darwin",
    "macOS 14, Intel": "x86_64-apple-darwin",
}
OPTIONAL = {  # which extras there are beside what is always needed
    "yes": ("photos", "fast"),
    "without pycolmap": ("fast",),
    "without numba": ("photos",),
    "without pycolmap and numba": (),
}
# What --quick leaves out: files and rooms of tests that take nine tenths of the time; every other room keeps some
SLOW = tuple(
    f"blender_tests/engine/{name}"
    for name in (
        "faults", "readers",
        "test_notebooks.py", "test_readme.py", "test_api.py", "cli/test_cli.py", "worker/test_jobs.py",
        "fields/test_registry.py", "fields/nerf/test_fit_nerf.py", "fields/voxels/test_fit.py",
        "fields/voxels/test_fit_open.py", "capture/test_triangulation.py", "commands/test_commits.py",
        "commands/test_geometry.py", "commands/test_nerf.py", "commands/test_nothing_seen.py",
        "commands/test_poses.py", "commands/test_sequences.py", "fields/test_resuming.py",
    )
)  # fmt: skip


@dataclass(frozen=True)
class Cell:
    """One line of the table.

    name: How it is called on the command line, and its environment's folder.
    python: The interpreter's version, as 3.12.
    requirements: What is installed, in ranges.
    resolution: Which versions of these ranges uv takes: `highest`, or `lowest-direct`.
    tests: The folder of its tests.
    """

    name: str
    python: str
    requirements: tuple[str, ...]
    resolution: str
    tests: str

    @property
    def has_blender(self) -> bool:
        """Whether the cell is about Blender's version, not about the engine's packages."""
        return self.name.startswith("addon")


class Unavailable(Exception):
    """A cell cannot be run here and now, which is not a fault of the program: its packages cannot be downloaded."""


class Unresolvable(Exception):
    """No versions of the packages go together on this Python."""


def all_cells() -> list[Cell]:
    """Blender's cells, then the engine's: the lowest versions of its ranges, then the newest on each Python."""
    extras = [
        wanted for extra in ("photos", "fast", "splats", "metrics", "test", "readers") for wanted in EXTRAS[extra]
    ]
    engine = (*PROJECT["dependencies"], *extras, *WHEEL_TEST)
    blender = [
        Cell(name, python, (*wanted, *PICTURES, *EXTRAS["test"]), "highest", "blender_tests/addon")
        for name, (python, wanted) in BLENDERS.items()
    ]
    lowest = Cell("engine-lowest", PYTHONS[0], engine, "lowest-direct", "blender_tests/engine")
    newest = [Cell(f"engine-{python}", python, engine, "highest", "blender_tests/engine") for python in PYTHONS]
    return [*blender, lowest, *newest]


def install(cell: Cell, environment: Path) -> None:
    """Install a cell's packages into an environment. Only wheels: nothing is compiled.

    Raises:
        Unavailable: They cannot be downloaded.
        Unresolvable: No versions go together.
    """
    _uv("pip", "install", "--upgrade", "--python", str(environment), "--resolution", cell.resolution,
        "--only-binary", ":all:", *cell.requirements)  # fmt: skip


def has_wheels(python: str, platform: str) -> str:
    """Tell whether the index has the engine's packages ready to install: a key of `OPTIONAL`, or `no`.

    Raises:
        Unavailable: The index does not answer.
    """
    for answer, extras in OPTIONAL.items():
        wanted = [*PROJECT["dependencies"], *EXTRAS["metrics"], *(one for extra in extras for one in EXTRAS[extra])]
        options = ["--only-binary", ":all:", "--quiet", "--python-platform", platform, "--python-version", python]
        try:
            _uv("pip", "compile", "-", *options, input="\n".join(wanted), MACOSX_DEPLOYMENT_TARGET="14.0")
            return answer
        except Unresolvable:
            continue
    return "no"


def _uv(*arguments: str, input: str | None = None, **variables: str) -> None:
    done = subprocess.run([sys.executable, "-m", "uv", *arguments], env=os.environ | variables, input=input,
                          stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, encoding="utf-8")  # fmt: skip
    if done.returncode == 0:
        return
    print(done.stderr.strip(), flush=True)
    if "No solution found" in done.stderr:
        raise Unresolvable("no versions of its packages go together")
    raise Unavailable("its packages could not be downloaded or installed")
