"""Blender's message bus: functions that are called when a property is set by the user or by a script, and not by undo.

A file that is opened has a bus of its own, on which they are put anew. In background mode there is none.
"""

from collections.abc import Callable

import bpy
from bpy.app.handlers import persistent

from . import handlers

Key = tuple[type, str]  # a type of Blender's, and the name of a property that it has
Listener = Callable[[], None]


class _Memory:
    """Who listens to what; each function owns its subscriptions."""

    listeners: list[tuple[Key, Listener]] = []


def listen(key: Key, listener: Listener) -> None:
    """Have a function called whenever this property of anything of the type is set."""
    _Memory.listeners.append((key, listener))
    _subscribe(key, listener)


def forget(listener: Listener) -> None:
    """No longer call it."""
    bpy.msgbus.clear_by_owner(listener)
    _Memory.listeners = [each for each in _Memory.listeners if each[1] != listener]


def _subscribe(key: Key, listener: Listener) -> None:
    bpy.msgbus.subscribe_rna(key=key, owner=listener, args=(), notify=listener)


@persistent
def _after_load(*_):
    for _, listener in _Memory.listeners:
        bpy.msgbus.clear_by_owner(listener)
    for key, listener in _Memory.listeners:
        _subscribe(key, listener)


HANDLERS = (("load_post", _after_load),)


def register():
    """Called when the extension is enabled."""
    handlers.add(HANDLERS)


def unregister():
    """Called when the extension is disabled."""
    handlers.remove(HANDLERS)
