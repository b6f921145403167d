"""Runs timers in place of Blender's window loop."""

import time
from types import SimpleNamespace


def run_to_end(tick, seconds=20):
    """Call a timer's function until it returns None."""
    deadline = time.monotonic() + seconds
    while tick() is not None:
        assert time.monotonic() < deadline, "the timer does not end"
        time.sleep(0.02)


def pretend_window(bpy, monkeypatch, *modules):
    """Make modules believe that Blender has a window, with timers that never fire."""
    timers = SimpleNamespace(is_registered=lambda tick: True, register=None, unregister=lambda tick: None)
    pretended = SimpleNamespace(app=SimpleNamespace(background=False, timers=timers), data=bpy.data, types=bpy.types)
    for module in modules:
        monkeypatch.setattr(module, "bpy", pretended)
