"""Builds of the extension, and a Blender of one's own that they are installed into."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

from tools.release.manifest import engine_version

ROOT = Path(__file__).resolve().parents[3]
EXTENSION = ("__init__.py", "blender_manifest.toml", "LICENSE", "CITATION.cff", "karf_engine", "karf_blender", "tools")
END = "\nsys.stdout.flush()\nos._exit(0)\n"  # Blender as a module may crash where the interpreter ends by itself


def build(checkout, out):
    """Build a checkout into a folder, which is returned."""
    command = [sys.executable, "-m", "tools.release", "--out", str(out)]
    done = subprocess.run(command, cwd=checkout, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return out


def build_as(version, folder):
    """Build this checkout under another version; returns what was built."""
    checkout = folder / "checkout"
    for name in EXTENSION:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, checkout / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            checkout.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, checkout)
    for name in ("blender_manifest.toml", "CITATION.cff", "karf_engine/version.py"):
        path = checkout / name
        path.write_text(path.read_text().replace(engine_version(ROOT), version, 1))
    return build(checkout, folder / "dist")


def in_blender(user, script, *arguments):
    """Run a script in a Blender of its own, with this folder as the user's; returns what it printed last, as JSON."""
    start = "import json, os, sys\nfrom pathlib import Path\nimport bpy\n"
    done = subprocess.run(
        [sys.executable, "-c", start + script + END, *map(str, arguments)],
        env=os.environ | {"BLENDER_USER_RESOURCES": str(user)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(done.stdout.strip().splitlines()[-1])
