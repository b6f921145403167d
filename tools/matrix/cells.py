"""The cells of the matrix: which tests run on which Blender or Python, with which packages.

Ranges and names of packages are those of pyproject.toml. Standard library only.
"""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
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
# What --quick leaves out: files of tests that take nine tenths of the time; every room keeps others
SLOW = tuple(
    f"blender_tests/engine/{name}.py"
    for name in (
        "test_notebooks", "test_library", "command_line/test_cli", "command_line/test_job_runs",
        "fields/test_registry", "fields/nerf/test_fit_nerf", "fields/voxels/test_fit", "fields/voxels/test_fit_open",
        "poses/test_triangulation", "stages/test_commits", "stages/test_geometry", "stages/test_kills",
        "stages/test_nerf", "stages/test_nothing_seen", "stages/test_poses", "stages/test_sequences",
        "tools/test_faults", "tools/test_readers", "training/test_resuming",
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
        """Whether it is Blender's version that matters, and not the engine's packages'."""
        return self.name.startswith("addon")

    @property
    def packages(self) -> list[str]:
        """The packages that are named in its ranges: what the table tells the versions of."""
        names = [re.match(r"[\w.-]+", requirement)[0].lower() for requirement in self.requirements]
        return [name for name in names if name not in ("setuptools", "packaging")]


def all_cells() -> list[Cell]:
    """Blender's cells, then the engine's: the lowest versions of its ranges, then the newest on each Python."""
    extras = [wanted for extra in ("photos", "fast", "metrics", "test") for wanted in EXTRAS[extra]]
    engine = (*PROJECT["dependencies"], *extras, *WHEEL_TEST)
    blender = [
        Cell(name, python, (*wanted, *PICTURES, *EXTRAS["test"]), "highest", "blender_tests/addon")
        for name, (python, wanted) in BLENDERS.items()
    ]
    lowest = Cell("engine-lowest", PYTHONS[0], engine, "lowest-direct", "blender_tests/engine")
    newest = [Cell(f"engine-{python}", python, engine, "highest", "blender_tests/engine") for python in PYTHONS]
    return [*blender, lowest, *newest]
