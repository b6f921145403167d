"""The extension's manifest, and the one version that all files must tell."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path
from typing import Any

MANIFEST = "blender_manifest.toml"
VERSION_FILE = "karf_engine/version.py"
CITATION = "CITATION.cff"


def read_manifest(root: Path) -> dict[str, Any]:
    """The manifest of a checkout, whose version is that of the engine.

    Args:
        root: The checkout.

    Raises:
        SystemExit: A file tells another version; the sentence names both.
    """
    manifest = tomllib.loads((root / MANIFEST).read_text(encoding="utf-8"))
    version = engine_version(root)
    cited = _found(r"^version: (\S+)$", root / CITATION)
    for name, told in ((MANIFEST, manifest["version"]), (CITATION, cited)):
        if told != version:
            sys.exit(f"error: {name} says version {told}, {VERSION_FILE} says {version}. Change {name}.")
    return manifest


def engine_version(root: Path) -> str:
    """The version of engine and extension, whose one place is `karf_engine/version.py`."""
    return _found(r'^__version__ = "(.+)"$', root / VERSION_FILE)


def _found(pattern: str, path: Path) -> str:
    found = re.search(pattern, path.read_text(encoding="utf-8"), re.MULTILINE)
    if found is None:
        sys.exit(f"error: {path} tells no version ({pattern}).")
    return found[1]
