"""Checksums of a project's files, renewed after a file was changed on purpose: as a stranger's project may have them."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path


def renew_checksum(project: Path, path: Path) -> None:
    """Write the checksum of a stage's output, as it is now, into project.json."""
    state_file = project / "project.json"
    try:
        state = json.loads(state_file.read_text())
        noted = [entry["files"] for entry in state["stages"].values() if path.parent.name == entry.get("folder")]
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
        files[path.name] = hashlib.sha256(path.read_bytes()).hexdigest()
    state.pop("checksum", None)  # of project.json: without it what it says is believed
    state_file.write_text(json.dumps(state, indent=1) + "\n")
