"""The Blender side: cameras, swatches and pictures. It runs the engine in its own process and never imports torch."""

from . import operators, panels, preferences, properties
from .compositor import drivers
from .host import rendering
from .pictures import chips
from .project import disk, saving
from .rig import reprojection
from .swatches import recolor
from .tasks import ownership, runner
from .workspace import clicking, estimates, folding, opening, statusbar

# later ones use earlier ones: taken down in reverse
MODULES = (
    properties,
    preferences,
    rendering,
    chips,
    recolor,
    saving,
    drivers,
    reprojection,
    disk,
    ownership,
    runner,
    folding,
    statusbar,
    clicking,
    opening,
    estimates,
    operators,
    panels,
)


def register():
    """Register all classes and handlers."""
    for module in MODULES:
        module.register()


def unregister():
    """Take everything down again: jobs are ended, timers and handlers removed."""
    for module in reversed(MODULES):
        module.unregister()
