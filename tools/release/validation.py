"""Blender's own tool for extensions, where a Blender is at hand."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path


def find_tool(root: Path) -> list[str] | None:
    """The command that Blender's tool answers to: that of `.venv/blender`, or of a `blender` on the path; or None."""
    script = next((root / ".venv" / "blender").rglob("bl_pkg/cli/blender_ext.py"), None)
    if script is not None:
        return [sys.executable, "-I", str(script)]  # needs nothing but the standard library
    blender = shutil.which("blender")
    return [blender, "--command", "extension"] if blender else None


def validate(root: Path, package: Path) -> int:
    """Let Blender's tool judge a package, or say that none is at hand.

    Returns:
        The exit code: 0 where it is accepted, or nothing could judge it.
    """
    tool = find_tool(root)
    if tool is None:
        print(f"{package.name} was not validated: there is no .venv/blender and no blender on the path.")
        return 0
    print(f"{package.name}, says Blender's tool:", flush=True)
    return subprocess.run([*tool, "validate", str(package)]).returncode
