"""Read and write project.json, the state of a project.

A state is a dictionary of JSON values:

    schema      `SCHEMA`
    capture     path of the project's capture
    settings    all settings, by stage
    stages      for each finished stage: fingerprint, folder, files (name -> SHA-256), settings, seconds, metrics
    outdated    stages that were finished before a stage that they build on was run again
    checksum    of the other entries, to detect damage; removed by `read_state`
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import DataError
from ..io.files import fingerprint, read_json, write_json

SCHEMA = "karf-project/1"
STAGE_ORDER = ("geometry", "segmentation", "palette", "recoloring", "splats")
# incremented when the same inputs would give another result
STAGE_VERSIONS = {"geometry": 4, "segmentation": 5, "palette": 1, "recoloring": 1, "splats": 6}
BUILT_ON = {"segmentation": "geometry", "palette": "segmentation", "recoloring": "palette", "splats": "geometry"}


def read_state(path: Path) -> dict[str, Any]:
    """Read a project.json, without its checksum. Raises DataError if it is missing, damaged or of another schema."""
    if not path.exists():
        raise DataError(
            "{folder} is not a KaRF project (project.json is missing).",
            "Give the folder that the geometry stage wrote.",
            folder=path.parent,
        )
    state = read_json(path, "project state")
    schema = state.get("schema") if isinstance(state, dict) else None
    if schema != SCHEMA:
        raise DataError(f"{path} has schema {schema!r:.200}, not {SCHEMA}.", "Update KaRF, or start anew.")
    if not isinstance(state.get("capture"), str) or not isinstance(state.get("stages"), dict):
        raise DataError(f"{path} lacks its capture or its stages.", "Start anew in an empty folder.")
    if state.pop("checksum", None) not in (None, _digest(state)):
        raise DataError(
            f"{path} is damaged, or was changed by hand: its checksum differs.",
            "Restore it from a backup; after a change that was meant, remove its entry 'checksum'.",
        )
    if not isinstance(state.get("settings", {}), dict):
        raise DataError(f"{path} has the settings {state['settings']!r:.200}.", "Start anew.")
    if not isinstance(state.get("outdated", []), list):
        raise DataError(f"{path} has the outdated stages {state['outdated']!r:.200}.", "Start anew.")
    for stage, summary in state["stages"].items():
        is_summary = isinstance(summary, dict) and isinstance(summary.get("fingerprint"), str)
        if not is_summary or not isinstance(summary.get("files", {}), dict):
            raise DataError(
                f"{path} has no fingerprint, or no list of files, of its {stage!r:.200} stage, but {summary!r:.200}.",
                f"Remove {stage!r:.200} from its stages, and run that stage again.",
            )
    return state


def write_state(path: Path, state: dict[str, Any]) -> None:
    """Write a state atomically, with its checksum."""
    write_json(path, state | {"checksum": _digest(state)})


def without_stage(state: dict[str, Any], stage: str) -> dict[str, Any]:
    """Return the state without this stage and those that build on it."""
    outdated = {stage}
    for name in STAGE_ORDER:  # sorted by dependency
        if BUILT_ON.get(name) in outdated:
            outdated.add(name)
    stages = {name: summary for name, summary in state["stages"].items() if name not in outdated}
    unfinished = (outdated & state["stages"].keys() | set(state.get("outdated", ()))) - {stage}
    return state | {"stages": stages} | ({"outdated": sorted(unfinished)} if unfinished else {})


def result_fingerprint(state: Mapping[str, Any], stage: str) -> str:
    """Return a fingerprint of the results of a stage and the stages that it builds on; `state` may be empty."""
    summaries = {}
    while stage:
        summary = state.get("stages", {}).get(stage, {})
        summaries[stage] = [summary.get("fingerprint"), summary.get("files")]
        stage = BUILT_ON.get(stage, "")
    return fingerprint(summaries)


def _digest(state: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(state, sort_keys=True).encode()).hexdigest()[:16]
