"""For which systems and Pythons the index has all of the engine's packages ready to install. Nothing is downloaded."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

from . import environments
from .cells import PYTHONS, Cell, all_cells

PLATFORMS = {  # as uv calls them
    "Linux (glibc 2.28), x86-64": "x86_64-manylinux_2_28",
    "Linux (glibc 2.28), ARM": "aarch64-manylinux_2_28",
    "Windows, x86-64": "x86_64-pc-windows-msvc",
    "macOS 14, Apple silicon": "aarch64-apple-darwin",
    "macOS 14, Intel": "x86_64-apple-darwin",
}
MACOS = "14.0"


def ask() -> dict[str, dict[str, str]]:
    """`yes` or `no` by platform and Python.

    Raises:
        environments.Unavailable: The index does not answer.
    """
    newest = next(cell for cell in all_cells() if cell.name == f"engine-{PYTHONS[0]}")
    return {
        name: {python: _answer(replace(newest, python=python), uv) for python in PYTHONS}
        for name, uv in PLATFORMS.items()
    }


def _answer(cell: Cell, platform: str) -> str:
    try:
        environments.resolve(cell, Path(sys.executable), platform, MACOS)
        return "yes"
    except environments.Unresolvable:
        return "no"
