"""Whether Blender itself renders. Its render thread reads the file and calls handlers: what touches pixels or data
meanwhile crashes Blender, so nothing of ours does."""

import bpy
from bpy.app.handlers import persistent

from ..engine_api import BadRequest
from . import handlers


class _Memory:
    """Whether a render has begun and not ended."""

    begun: bool = False


def is_running() -> bool:
    """True from a render's first handler to its last; on any thread."""
    return _Memory.begun or bpy.app.is_job_running("RENDER")


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
    _Memory.begun = False
    return True


@persistent
def _begin(*_):
    _Memory.begun = True


@persistent
def _end(*_):
    _Memory.begun = False


HANDLERS = (("render_init", _begin), ("render_complete", _end), ("render_cancel", _end), ("load_post", _end))


def register():
    """Called when the extension is enabled."""
    handlers.add(HANDLERS)


def unregister():
    """Called when the extension is disabled."""
    handlers.remove(HANDLERS)
    _Memory.begun = False
