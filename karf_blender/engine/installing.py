"""The installation of the engine: alongside the interface, or blocking in background mode, where timers never fire."""

import sys
import time

import bpy

from ..engine_api import BadRequest, KarfError
from ..host import windows
from .managed.installation import Installation
from .managed.plan import Choices, Plan, make
from .managed.progress import Progress

POLL_SECONDS = 0.3
PRINT_SECONDS = 5.0


class _Memory:
    """The installation at work, and how the last one failed."""

    installation: Installation | None = None
    error: KarfError | None = None


def plan(choices: Choices) -> Plan:
    """What an installation would do, with this Blender's Python and as its preferences allow.

    Raises:
        KarfError: It cannot be done.
    """
    return make(choices, sys.executable, bpy.app.online_access)


def is_running() -> bool:
    """True while an installation is at work."""
    return _Memory.installation is not None


def progress() -> Progress | None:
    """How far it is; None while none is at work."""
    return _Memory.installation.progress if _Memory.installation else None


def last_error() -> KarfError | None:
    """How the last one failed or was cancelled; None where it did not."""
    return _Memory.error


def launch(planned: Plan) -> None:
    """Install alongside the interface and return at once; in background mode, block until it is done.

    Raises:
        KarfError: It cannot start; in background mode also: it fails.
    """
    if bpy.app.background:
        wait(planned)
        return
    _begin(planned)
    bpy.app.timers.register(_tick, first_interval=POLL_SECONDS, persistent=True)


def wait(planned: Plan) -> None:
    """Install, print how far it is, and block until it is done.

    Raises:
        KarfError: It fails.
    """
    installation = _begin(planned)
    printed, quiet_until = "", 0.0
    try:
        while not installation.ended:
            now = installation.poll()
            if now.title != printed or time.monotonic() > quiet_until:
                printed, quiet_until = now.title, time.monotonic() + PRINT_SECONDS
                print(f"KaRF engine: {now.sentence}", flush=True)
            time.sleep(POLL_SECONDS / 2)
        installation.check()
    finally:
        # also where the user interrupts with Ctrl-C
        _end()


def cancel() -> None:
    """Ask the installation to stop; what was fetched is kept.

    Raises:
        BadRequest: None is at work.
    """
    if _Memory.installation is None:
        raise BadRequest("No installation is running.", "")
    _Memory.installation.cancel()


def _begin(planned: Plan) -> Installation:
    if _Memory.installation is not None:
        raise BadRequest("The engine is being installed already.", "Wait for it, or cancel it.")
    _Memory.error = None
    _Memory.installation = Installation(planned)
    return _Memory.installation


def _end() -> None:
    """Forget the installation; its child is ended where it still lives."""
    if _Memory.installation is not None:
        _Memory.installation.terminate()
        _Memory.installation = None


def _tick() -> float | None:
    """The timer: lets the installation continue, and stops itself when it has ended."""
    installation = _Memory.installation
    if installation is None:
        return None
    installation.poll()
    windows.redraw("PREFERENCES")
    if not installation.ended:
        return POLL_SECONDS
    try:
        installation.check()
    except KarfError as error:
        _Memory.error = error
    _end()
    windows.redraw("PREFERENCES", *windows.PANEL_AREAS)
    return None


def unregister():
    """Called when the extension is disabled."""
    # a timer left behind hangs or crashes some Blender versions at exit
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    _end()
