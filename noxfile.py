"""The tests on other versions of Blender, Python and packages: python3 tools/dev.py matrix, which calls nox.

A session is a cell of tools/cells.py, in an environment of its own under .venv/matrix/. A cell whose interpreter is not
installed, or whose packages cannot be downloaded, is skipped.
"""

from __future__ import annotations

import os
from pathlib import Path

import nox

from tools import cells, dev

nox.options.default_venv_backend = "uv"
nox.options.download_python = "never"
nox.options.envdir = str(cells.ROOT / ".venv" / "matrix")
PYENV = sorted(Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")).glob("versions/*/bin"))
os.environ["PATH"] = os.pathsep.join([*map(str, PYENV), os.environ["PATH"]])  # found without being chosen in pyenv


def add_session(cell: cells.Cell) -> None:
    """Let nox know a cell; `quick` and `strict` are given after `--`."""

    @nox.session(name=cell.name, python=cell.python, reuse_venv=True, venv_params=["--seed"])
    def run(session: nox.Session) -> None:
        try:
            cells.install(cell, Path(session.virtualenv.location))
        except cells.Unresolvable as reason:
            session.error(str(reason))
        except cells.Unavailable as reason:
            (session.error if "strict" in session.posargs else session.skip)(str(reason))
        if cell.has_blender:  # with which a test writes the layers that Blender reads
            dev.setup("engine")
        slow = cells.SLOW if "quick" in session.posargs and not cell.has_blender else ()
        session.run("uv", "pip", "freeze", external=True)
        session.run(
            *("python", "-m", "pytest", cell.tests, *(f"--ignore={name}" for name in slow), "-p", "no:cacheprovider"),
            env={"KARF_ENGINE_PYTHON": str(dev.python_of("engine")), "OMP_NUM_THREADS": "1"},
        )


for cell in cells.all_cells():
    add_session(cell)


@nox.session(venv_backend="none", default=False)
def wheels(session: nox.Session) -> None:
    """Ask the index for which systems and Pythons it has all of the engine's packages; nothing is downloaded."""
    for name, platform in cells.PLATFORMS.items():
        answers = (f"{python}: {cells.has_wheels(python, platform)}" for python in cells.PYTHONS)
        session.log(f"{name}  {'  '.join(answers)}")
