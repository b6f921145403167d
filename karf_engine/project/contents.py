"""Read a project's capture and settings."""

from __future__ import annotations

from dataclasses import replace

from ..capture.capture import Capture, capture_from_json
from ..errors import BadRequest
from ..io.files import read_json
from . import settings as settings_module
from .folder import Project
from .settings import Settings
from .state import STAGE_ORDER


def read_capture(project: Project) -> Capture:
    """Return the capture that the project was learned from. Raises DataError where its file is damaged."""
    path = project.verified(project.capture_file)
    return capture_from_json(read_json(path, "capture"), path)


def settings_for(project: Project, stage: str) -> Settings:
    """Return the settings for a stage: earlier stages' settings as they ran, the others as last set.

    A `stage` that is none of `STAGE_ORDER` is a command after all of them. Raises BadRequest without finished geometry.
    """
    state = project.state()
    if state.get("settings") is None:
        raise BadRequest(f"{project.folder} has no settings yet.", "Run the geometry stage first.")
    settings = settings_module.from_dict(state["settings"])
    before = STAGE_ORDER[: STAGE_ORDER.index(stage)] if stage in STAGE_ORDER else STAGE_ORDER
    for name in before:
        used = state["stages"].get(name, {}).get("settings")
        if used is not None:
            own = settings_module.from_dict(used, type(getattr(settings, name)))
            settings = replace(settings, **{name: own})
    return settings
