"""Pictures that stand still are packed into the .blend, so that Blender knows them as kept.

On saving and on quitting it asks whether to save modified images, and would ask about these, which save themselves.
"""

import time
from dataclasses import dataclass, field

import bpy

from .. import session
from ..host import rendering

STILL_SECONDS = 0.5  # that a picture has not changed: one that follows the mouse is not packed at every step


@dataclass
class _State:
    """When a picture has changed last, and the names of those that did."""

    changed: float = 0.0
    names: set[str] = field(default_factory=set)


def note_change(image: bpy.types.Image) -> None:
    """A picture has other pixels now. In background mode, where nobody is asked, saving packs it."""
    if bpy.app.background:
        return
    session.get(_State).changed = time.monotonic()
    session.get(_State).names.add(image.name)
    session.start_timer(_tick, STILL_SECONDS)


def _tick() -> float | None:
    """The timer: packs what has changed, once nothing changes any more."""
    if time.monotonic() - session.get(_State).changed < STILL_SECONDS or not rendering.is_over():
        return STILL_SECONDS
    for name in session.get(_State).names & set(bpy.data.images.keys()):
        pack(bpy.data.images[name])
    session.get(_State).names.clear()
    return None


def pack(image: bpy.types.Image | None) -> None:
    """Put the pixels of a picture into the .blend where they are only in memory, which is not saved."""
    if image is not None and image.is_dirty:
        image.pack()
