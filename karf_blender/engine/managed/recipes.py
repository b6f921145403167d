"""Recipes: of which files the environment is made on each system, with their sizes and hashes. No bpy.

`recipes.json` is written by `python3 tools/dev.py lock`. It names files, and never where they lie.
"""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from typing import Any

from ...engine_api import MissingDependency, read_json
from . import lists

FILE = lists.RECIPES
EXTRAS = {  # optional parts that may be ticked, and what each is for
    "photos": "pycolmap: camera poses of photos that have none",
    "fast": "numba: needed for splats on every device; scenes are learned 1.7 times as fast on the processor",
}
USUAL = ("fast",)  # parts that are ticked by default


@dataclass(frozen=True)
class Wheel:
    """A package's file. size: in bytes. sha256: of the file, as hexadecimal text."""

    file: str
    name: str
    version: str
    size: int
    sha256: str

    @property
    def requirement(self) -> str:
        """The line of a requirements file that allows this file only."""
        return lists.requirement(self.name, self.version, self.sha256)


@dataclass(frozen=True)
class Recipe:
    """The files for one system and Python. parts: `uv`, `base`, `torch`, and an extra's name where it has files."""

    platform: str
    python: str
    parts: dict[str, tuple[Wheel, ...]]

    @property
    def torch_version(self) -> str:
        """The version of torch, of every build."""
        return next(wheel.version for wheel in self.parts["torch"] if wheel.name == "torch")

    def parts_of(self, backend: str, extras: Iterable[str]) -> tuple[str, ...]:
        """The parts that make an environment; a build of torch that comes by uv's backend has no file here.

        Raises:
            MissingDependency: An extra is not to be had on this system.
        """
        lacking = sorted(set(extras) - self.parts.keys())
        if lacking:
            raise MissingDependency(
                f"{', '.join(lacking)} cannot be had for Python {self.python} on {self.platform}.", "Untick it."
            )
        return ("base", *(() if backend else ("torch",)), *sorted(extras))

    def wheels(self, backend: str, extras: Iterable[str]) -> tuple[Wheel, ...]:
        """The files of these parts."""
        return tuple(wheel for part in self.parts_of(backend, extras) for wheel in self.parts[part])

    def digest(self, build: str, backend: str, extras: Iterable[str]) -> str:
        """A fingerprint of what an environment is made of."""
        lines = sorted(wheel.sha256 for wheel in self.wheels(backend, extras))
        return hashlib.sha256("\n".join([*lines, self.torch_version, build]).encode()).hexdigest()


def find(platform: str, python: str) -> Recipe:
    """The recipe for a system (as `machine` calls it) and a Python (`3.11`).

    Raises:
        MissingDependency: There is none.
    """
    known = _content()["recipes"].get(platform)
    if known is None:
        raise MissingDependency(
            f"KaRF knows no engine for {platform}.", "Make an environment by hand and set Engine Python to it."
        )
    if python not in known:
        raise MissingDependency(
            f"KaRF knows no engine for Python {python} on {platform}.", f"Use Python {' or '.join(known)}."
        )
    wheels = _content()["wheels"]
    parts = {name: tuple(Wheel(file, **wheels[file]) for file in files) for name, files in known[python].items()}
    return Recipe(platform, python, parts)


def pythons(platform: str) -> tuple[str, ...]:
    """The Pythons for which a system has a recipe, oldest first."""
    return tuple(_content()["recipes"].get(platform, ()))


@cache
def _content() -> dict[str, Any]:
    return read_json(FILE, "recipes of the engine")
