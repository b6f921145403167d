"""Pictures that stand still are packed into the .blend, so that Blender knows them as kept.

On saving and on quitting it asks whether to save modified images, and would ask about these, which save themselves.
"""

import time

import bpy

from ..host import rendering

STILL_SECONDS = 0.5  # that a picture has not changed: one that follows the mouse is not packed at every step


class _Memory:
    """When a picture has changed last, and the names of those that did."""

    changed: float = 0.0
    names: set[str] = set()


def note_change(image: bpy.types.Image) -> None:
    """A picture has other pixels now. In background mode, where nobody is asked, saving packs it."""
    if bpy.app.background:
        return
    _Memory.changed = time.monotonic()
    _Memory.names.add(image.name)
    if not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=STILL_SECONDS)


def _tick() -> float | None:
    """The timer: packs what has changed, once nothing changes any more."""
    if time.monotonic() - _Memory.changed < STILL_SECONDS or not rendering.is_over():
        return STILL_SECONDS
    for name in _Memory.names & set(bpy.data.images.keys()):
        pack(bpy.data.images[name])
    _Memory.names.clear()
    return None


def pack(image: bpy.types.Image | None) -> None:
    """Put the pixels of a picture into the .blend where they are only in memory, which is not saved."""
    if image is not None and image.is_dirty:
        image.pack()


def register():
    """Called when the extension is enabled."""


def unregister():
    """Called when the extension is disabled."""
    # a timer left behind hangs or crashes some Blender versions at exit
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    _Memory.names.clear()
