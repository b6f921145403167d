"""A repository of extensions as static files: any web server, or a folder, that Blender can be pointed at.

Its list is what `blender --command extension server-generate --repo-dir DIR` writes: the extensions listing API, v1.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

LIST = "index.json"
NOT_LISTED = ("build", "wheels")  # parts of a manifest


def write_repository(folder: Path, package: Path, manifest: Mapping[str, Any]) -> None:
    """Make a folder a repository of one extension; a zip of another version in it is removed.

    Args:
        folder: Made if needed.
        package: The extension's zip, which is copied.
        manifest: What the zip's manifest says.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for other in folder.glob(f"{manifest['id']}-*.zip"):
        other.unlink()
    shutil.copyfile(package, folder / package.name)
    listed = {name: value for name, value in manifest.items() if name not in NOT_LISTED}
    listed |= {
        "archive_url": f"./{package.name}",
        "archive_size": package.stat().st_size,
        "archive_hash": f"sha256:{sha256(package)}",
    }
    content = {"version": "v1", "blocklist": [], "data": [listed]}
    (folder / LIST).write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8", newline="\n")


def write_checksums(path: Path, files: list[Path]) -> None:
    """Write the SHA-256 of files below the folder of `path`, as `sha256sum --check` reads them."""
    lines = [f"{sha256(file)}  {file.relative_to(path.parent).as_posix()}\n" for file in sorted(files)]
    path.write_text("".join(lines), encoding="utf-8", newline="\n")


def sha256(path: Path) -> str:
    """SHA-256 of a file, as hexadecimal text."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
