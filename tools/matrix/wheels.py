"""For which systems and Pythons the index has all of the engine's packages ready to install. Nothing is downloaded."""

from __future__ import annotations

import sys
from pathlib import Path

from . import environments
from .cells import EXTRAS, PROJECT, PYTHONS, Cell

PLATFORMS = {  # as uv calls them
    "Linux (glibc 2.28), x86-64": "x86_64-manylinux_2_28",
    "Linux (glibc 2.28), ARM": "aarch64-manylinux_2_28",
    "Windows, x86-64": "x86_64-pc-windows-msvc",
    "macOS 14, Apple silicon": "aarch64-apple-darwin",
    "macOS 14, Intel": "x86_64-apple-darwin",
}
MACOS = "14.0"
ANSWERS = {  # which extras there are beside what is always needed
    "yes": ("photos", "fast"),
    "without pycolmap": ("fast",),
    "without numba": ("photos",),
    "without pycolmap and numba": (),
}


def ask() -> dict[str, dict[str, str]]:
    """By platform and Python: `yes`, without the packages of which extras, or `no`.

    Raises:
        environments.Unavailable: The index does not answer.
    """
    return {name: {python: _answer(python, uv) for python in PYTHONS} for name, uv in PLATFORMS.items()}


def _answer(python: str, platform: str) -> str:
    needed = (*PROJECT["dependencies"], *EXTRAS["metrics"])
    for answer, extras in ANSWERS.items():
        optional = [wanted for extra in extras for wanted in EXTRAS[extra]]
        cell = Cell("wheels", python, (*needed, *optional), "highest", "")
        try:
            environments.resolve(cell, Path(sys.executable), platform, MACOS)
            return answer
        except environments.Unresolvable:
            continue
    return "no"
