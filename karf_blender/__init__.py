"""The Blender side: cameras, swatches and pictures. It runs the engine in its own process and never imports torch."""

from . import disk, job_watch, operators, ownership, panels, preferences, properties, recolor, rendering, reprojection

# later ones use earlier ones: taken down in reverse
MODULES = (properties, preferences, rendering, recolor, reprojection, disk, ownership, job_watch, operators, panels)


def register():
    """Register all classes and handlers."""
    for module in MODULES:
        module.register()


def unregister():
    """Take everything down again: jobs are ended, timers and handlers removed."""
    for module in reversed(MODULES):
        module.unregister()
