"""The installation of the engine: alongside the interface, or blocking in background mode, where timers never fire."""

import sys
import time
from dataclasses import dataclass

import bpy

from .. import session
from ..engine_api import BadRequest, KarfError
from ..host import windows
from .managed.installation import Installation
from .managed.plan import Choices, Plan, make
from .managed.progress import Progress

POLL_SECONDS = 0.3
PRINT_SECONDS = 5.0


@dataclass
class _State:
    """The installation at work, and how the last one failed."""

    installation: Installation | None = None
    error: KarfError | None = None

    def close(self) -> None:
        """End the installation and its child."""
        if self.installation is not None:
            self.installation.terminate()
            self.installation = None


def plan(choices: Choices) -> Plan:
    """What an installation would do, with this Blender's Python and as its preferences allow.

    Raises:
        KarfError: It cannot be done.
    """
    return make(choices, sys.executable, bpy.app.online_access)


def is_running() -> bool:
    """True while an installation is at work."""
    return session.get(_State).installation is not None


def progress() -> Progress | None:
    """How far it is; None while none is at work."""
    return session.get(_State).installation.progress if session.get(_State).installation else None


def last_error() -> KarfError | None:
    """How the last one failed or was cancelled; None where it did not."""
    return session.get(_State).error


def launch(planned: Plan) -> None:
    """Install alongside the interface and return at once; in background mode, block until it is done.

    Raises:
        KarfError: It cannot start; in background mode also: it fails.
    """
    if bpy.app.background:
        wait(planned)
        return
    _begin(planned)
    session.start_timer(_tick, POLL_SECONDS, persistent=True)


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
    if session.get(_State).installation is None:
        raise BadRequest("No installation is running.", "")
    session.get(_State).installation.cancel()


def _begin(planned: Plan) -> Installation:
    if session.get(_State).installation is not None:
        raise BadRequest("The engine is already being installed.", "Wait for it, or cancel it.")
    session.get(_State).error = None
    session.get(_State).installation = Installation(planned)
    return session.get(_State).installation


def _end() -> None:
    session.get(_State).close()


def _tick() -> float | None:
    """The timer: lets the installation continue, and stops itself when it has ended."""
    installation = session.get(_State).installation
    if installation is None:
        return None
    installation.poll()
    windows.redraw("PREFERENCES")
    if not installation.ended:
        return POLL_SECONDS
    try:
        installation.check()
    except KarfError as error:
        session.get(_State).error = error
    _end()
    windows.redraw("PREFERENCES", *windows.PANEL_AREAS)
    return None
