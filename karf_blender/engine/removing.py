"""The end of the engine's environment: deleted alongside the interface, or at once in background mode."""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import bpy

from .. import session
from ..engine_api import KarfError
from ..host import windows
from .managed import home

SLICE_SECONDS = 0.05  # time for which the interface may stand still
PAUSE_SECONDS = 0.01


@dataclass
class _State:
    """What is being deleted, and how the last time failed."""

    work: Iterator[None] | None = None
    error: KarfError | None = None


def is_running() -> bool:
    """True while an environment is being deleted."""
    return session.get(_State).work is not None


def last_error() -> KarfError | None:
    """How the last time failed; None where it did not."""
    return session.get(_State).error


def launch(folder: Path) -> None:
    """Delete the environment in a folder and return at once; in background mode, block until it is done.

    Raises:
        KarfError: In background mode: the folder is not KaRF's, or a file cannot be deleted.
    """
    if bpy.app.background:
        home.remove(folder)
        return
    _begin(folder)
    session.start_timer(_tick, persistent=True)


def _begin(folder: Path) -> None:
    session.get(_State).work, session.get(_State).error = home.removing(folder), None


def _tick() -> float | None:
    """The timer: deletes for a moment, and stops itself at the end."""
    until = time.monotonic() + SLICE_SECONDS
    try:
        for _ in session.get(_State).work:
            if time.monotonic() > until:
                return PAUSE_SECONDS
    except KarfError as error:
        session.get(_State).error = error
    session.get(_State).work = None
    windows.redraw("PREFERENCES", *windows.PANEL_AREAS)
    return None
