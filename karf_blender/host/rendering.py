"""Whether Blender renders: touching pixels or data while its render thread reads the file crashes Blender."""

from dataclasses import dataclass

import bpy

from .. import session
from ..engine_api import BadRequest


@dataclass
class Render:
    per_file = True
    has_begun: bool = False


def is_running() -> bool:
    """Return True from a render's first handler to its last; on any thread."""
    return session.get(Render).has_begun or bpy.app.is_job_running("RENDER")


def refuse() -> None:
    """Raise BadRequest during a render."""
    if is_running():
        raise BadRequest("Blender is rendering.", "Wait until it is done, or cancel it.")


def is_over() -> bool:
    """Return True if no render job is running. Only for timers: Blender never calls them within a render."""
    if bpy.app.is_job_running("RENDER"):
        return False
    session.get(Render).has_begun = False
    return True


@session.handler("render_init", phase=session.Phase.STATE)
def _begin(*_):
    session.get(Render).has_begun = True


@session.handler("render_complete", "render_cancel", phase=session.Phase.STATE)
def _end(*_):
    session.get(Render).has_begun = False
