"""Build the release into a folder: `python -m tools.release [--out DIR]`. Needs Python 3.11 and nothing else."""

from __future__ import annotations

import argparse
import hashlib
import json
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tools.evaluate.pages import stale_tables
from tools.release.manifest import read_manifest
from tools.release.packing import packed_files, write_zip

ROOT = Path(__file__).resolve().parents[2]
LIST = "index.json"
VIEWER = "karf_engine/export/page/web/dist/page.js"
NOT_LISTED = ("build", "wheels")  # parts of a manifest


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="folder (default: dist)")
    parser.add_argument("--release", action="store_true", help="for publishing: refuse while a table is stale")
    options = parser.parse_args()
    stale = stale_tables() if options.release else {}
    for name, modules in stale.items():
        print(f"error: the table {name} is stale: {', '.join(modules) or 'never measured'}", file=sys.stderr)
    if stale:
        print("Measure them by: python3 tools/dev.py evaluate", file=sys.stderr)
        return 1
    return build(ROOT, options.out)


def build(root: Path, out: Path) -> int:
    """Pack the extension of a checkout, list it as a repository, write checksums, and validate the package.

    Returns:
        The exit code.
    """
    manifest = read_manifest(root)
    out.mkdir(parents=True, exist_ok=True)
    package = out / f"{manifest['id']}-{manifest['version']}.zip"
    packed = packed_files(root, manifest["build"]["paths_exclude_pattern"])
    write_zip(package, root, packed)
    if VIEWER not in packed:
        print(f"{package.name} exports no web pages: their viewer is not built. Build it by: python3 tools/dev.py page")
    listed = write_repository(out / "repository", package, manifest)
    checksums = [f"{sha256(file)}  {file.relative_to(out).as_posix()}\n" for file in sorted([package, *listed])]
    (out / "SHA256SUMS").write_text("".join(checksums), encoding="utf-8", newline="\n")
    print(f"{package}: {package.stat().st_size / 1000:.0f} kB, SHA-256 {sha256(package)}")
    return validate(root, package)


def write_repository(folder: Path, package: Path, manifest: Mapping[str, Any]) -> list[Path]:
    """Make a folder a repository of one extension, which Blender can be pointed at; a zip of another version is removed.

    Its list is what `blender --command extension server-generate --repo-dir DIR` writes: the extensions listing API, v1.

    Returns:
        Its files.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for other in folder.glob(f"{manifest['id']}-*.zip"):
        other.unlink()
    copy, index = folder / package.name, folder / LIST
    shutil.copyfile(package, copy)
    listed = {name: value for name, value in manifest.items() if name not in NOT_LISTED}
    listed |= {
        "archive_url": f"./{package.name}",
        "archive_size": package.stat().st_size,
        "archive_hash": f"sha256:{sha256(package)}",
    }
    content = {"version": "v1", "blocklist": [], "data": [listed]}
    index.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8", newline="\n")
    return [copy, index]


def sha256(path: Path) -> str:
    """The SHA-256 of a file, as hexadecimal text."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def validate(root: Path, package: Path) -> int:
    """Let Blender's tool judge a package: that of `.venv/blender`, or of a `blender` on the path.

    Returns:
        The exit code: 0 where it is accepted, or no tool is at hand.
    """
    script = next((root / ".venv" / "blender").rglob("bl_pkg/cli/blender_ext.py"), None)
    blender = shutil.which("blender")
    if script is not None:
        tool = [sys.executable, "-I", str(script)]  # needs nothing but the standard library
    elif blender is not None:
        tool = [blender, "--command", "extension"]
    else:
        print(f"{package.name} was not validated: there is no .venv/blender and no blender on the path.")
        return 0
    print(f"{package.name}, says Blender's tool:", flush=True)
    return subprocess.run([*tool, "validate", str(package)]).returncode


if __name__ == "__main__":
    sys.exit(main())
