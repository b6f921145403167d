"""Checksums of a project's files, renewed after a file was changed on purpose: as a stranger's project may have them."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path


def renew_checksum(project: Path, name: str) -> None:
    """Let project.json note this file's content as it is now, where it notes it at all."""
    state_file = project / "project.json"
    try:
        state = json.loads(state_file.read_text())
        noted = [entry["files"] for entry in state["stages"].values() if name in entry.get("files", {})]
    except (
        OSError,
        ValueError,
        KeyError,
        AttributeError,
        TypeError,
    ):  # project.json itself was changed, or there is none
        return
    if not noted:
        return
    for files in noted:
        files[name] = hashlib.sha256((project / name).read_bytes()).hexdigest()
    state.pop("checksum", None)  # of project.json: without it what it says is believed
    state_file.write_text(json.dumps(state, indent=1) + "\n")
