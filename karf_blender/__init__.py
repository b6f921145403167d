"""The Blender side: cameras, swatches and pictures. It runs the engine in its own process and never imports torch."""

import sys

from . import session


def register():
    """Register all classes, handlers and timers."""
    session.register(sys.modules[__name__])


def unregister():
    """Take everything down again: jobs are ended, timers and handlers removed."""
    session.unregister()
