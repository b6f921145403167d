"""Whether Blender itself renders. Its render thread reads the file and calls handlers: what touches pixels or data
meanwhile crashes Blender, so nothing of ours does."""

from dataclasses import dataclass

import bpy

from .. import session
from ..engine_api import BadRequest


@dataclass
class Render:
    """Whether a render has begun and not ended."""

    per_file = True
    has_begun: bool = False


def is_running() -> bool:
    """True from a render's first handler to its last; on any thread."""
    return session.get(Render).has_begun or bpy.app.is_job_running("RENDER")


def refuse() -> None:
    """Refuse what must not happen while Blender renders.

    Raises:
        BadRequest: Blender renders.
    """
    if is_running():
        raise BadRequest("Blender is rendering.", "Wait until it is done, or cancel it.")


def is_over() -> bool:
    """For timers, which Blender calls beside a render job and never within a render: True if none is running."""
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
