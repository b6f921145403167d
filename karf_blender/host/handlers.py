"""Putting functions on Blender's application handlers, and taking them off again."""

from collections.abc import Callable, Sequence

import bpy

Handlers = Sequence[tuple[str, Callable]]  # names of lists in `bpy.app.handlers`, and what joins them


def add(handlers: Handlers) -> None:
    """Put every function at the end of its list."""
    for name, handler in handlers:
        getattr(bpy.app.handlers, name).append(handler)


def remove(handlers: Handlers) -> None:
    """Take every function off its list."""
    for name, handler in reversed(handlers):
        getattr(bpy.app.handlers, name).remove(handler)
