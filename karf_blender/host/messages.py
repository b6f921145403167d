"""Blender's message bus: functions that are called when a property is set by the user or by a script, and not by undo.

A file that is opened has a bus of its own, on which they are put anew. In background mode there is none.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import bpy

from .. import session

Key = tuple[type, str]  # a type of Blender's, and the name of a property that it has
Listener = Callable[[], None]


@dataclass
class Listeners:
    """Who listens to what; each function owns its subscriptions."""

    known: list[tuple[Key, Listener]] = field(default_factory=list)


def listen(key: Key, listener: Listener) -> None:
    """Have a function called whenever this property of anything of the type is set."""
    session.get(Listeners).known.append((key, listener))
    _subscribe(key, listener)


def forget(listener: Listener) -> None:
    """No longer call it."""
    bpy.msgbus.clear_by_owner(listener)
    session.get(Listeners).known = [each for each in session.get(Listeners).known if each[1] != listener]


def on(*keys: Key) -> Callable[[Listener], Listener]:
    """Declare a function that is called whenever one of these properties is set, as long as the session lasts."""

    def declare(function: Listener) -> Listener:
        @session.setup
        def subscription():
            for key in keys:
                listen(key, function)
            yield
            forget(function)

        function.karf_setup = subscription.karf_setup
        return function

    return declare


def _subscribe(key: Key, listener: Listener) -> None:
    bpy.msgbus.subscribe_rna(key=key, owner=listener, args=(), notify=listener)


@session.handler("load_post")
def _after_load(*_):
    for _, listener in session.get(Listeners).known:
        bpy.msgbus.clear_by_owner(listener)
    for key, listener in session.get(Listeners).known:
        _subscribe(key, listener)
