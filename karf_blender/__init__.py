"""The Blender side: cameras, swatches and pictures. It runs the engine in its own process and never imports torch."""

import sys

from . import session


def register():
    """Register all classes, handlers and timers."""
    session.register(sys.modules[__name__])


def unregister():
    """Take everything down again: jobs are ended, timers and handlers removed."""
    session.unregister()


def __getattr__(name):
    if name == "headless":
        raise ImportError(
            "headless is now steps: import steps as karf, give each step the scene first, as in "
            "karf.set_swatch(scene, ..), and wait for those that learn or render: karf.learn_scene(scene).wait()."
        )
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
