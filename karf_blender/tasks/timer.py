"""One timer of Blender polls what runs beside the interface: a modal operator would hold back auto-save for as long.

In background mode timers never fire: there tasks and queries block. What runs ends with Blender and with the extension.
"""

import traceback
from collections.abc import Callable

import bpy
from bpy.app.handlers import persistent

from ..host import compat

FIRST_SECONDS = 0.02

Poll = Callable[[], float | None]  # returns the seconds until it wants to be called again; None: no more

_polls: list[Poll] = []
_endings: list[Callable[[], None]] = []


def start(poll: Poll) -> None:
    """Have a function called, soon and then as often as it says."""
    if poll not in _polls:
        _polls.append(poll)
    if not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=FIRST_SECONDS, persistent=True)


def at_end(ending: Callable[[], None]) -> None:
    """Have a function called when Blender quits or the extension is disabled."""
    _endings.append(ending)


def _tick() -> float | None:
    seconds = [wanted for poll in tuple(_polls) if (wanted := _called(poll)) is not None]
    return min(seconds, default=FIRST_SECONDS if _polls else None)


def _called(poll: Poll) -> float | None:
    seconds = None
    try:
        seconds = poll()
    except Exception:  # as Blender prints it, which would stop the other functions too
        traceback.print_exc()
    if seconds is None and poll in _polls:
        _polls.remove(poll)
    return seconds


@persistent
def _end_all(*_):
    for ending in _endings:
        ending()


def register():
    """Called when the extension is enabled."""
    if compat.exit_handlers() is not None:
        compat.exit_handlers().append(_end_all)


def unregister():
    """Called when the extension is disabled."""
    if compat.exit_handlers() is not None:
        compat.exit_handlers().remove(_end_all)
    # a timer left behind hangs or crashes some Blender versions at exit
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    _polls.clear()
    _end_all()
