"""The engine's Python, asked whether it can run the engine."""

import bpy

from .. import engine_api, preferences
from ..engine import examination
from ..engine_api import ERROR, Finding, error_from_code
from ..project import folders


def examine_engine(scene: bpy.types.Scene | None = None) -> tuple[Finding, ...]:
    """Test Engine: ask for packages, device and disk, and try each stage on a tiny scene; prints what was found.

    Args:
        scene: The one whose project's disk is looked at.

    Returns:
        The findings; the last one sums up.
    """
    folder = folders.likely_project(scene or bpy.context.scene)
    python, threads = preferences.engine_python(), preferences.current().threads
    found = examination.examine(python, engine_api.ENGINE_FOLDER, folder, threads).findings
    for finding in found:
        print(f"KaRF engine: {finding.to_text()}", flush=True)
    verdict = found[-1]
    if verdict.status == ERROR:
        raise error_from_code(verdict.code, verdict.sentence, " ".join(verdict.lines[1:]))
    return found
