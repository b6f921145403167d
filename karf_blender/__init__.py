"""The Blender side: cameras, swatches and pictures. It runs the engine in its own process and never imports torch."""

from . import operators, panels, preferences, properties, render_engine, translations
from .host import messages, rendering
from .marking import following, overlay, tools
from .nodes import drivers
from .pictures import chips, settling
from .project import disk, moving, saving
from .rig import reprojection
from .steps import preview, splats
from .swatches import drawn_over, groups, material, shown
from .tasks import ownership, runner, timer
from .workspace import asking, clicking, estimates, folding, opening, own_pictures, statusbar, undoing

# later ones use earlier ones: taken down in reverse
MODULES = (
    translations,
    properties,
    preferences,
    messages,
    rendering,
    chips,
    settling,
    moving,  # before all that reads projects after undo
    groups,  # before what shows the swatches that it moves
    material,
    shown,
    saving,
    drivers,
    reprojection,
    overlay,
    drawn_over,
    following,
    disk,
    ownership,
    timer,
    runner,
    preview,
    splats,
    folding,
    statusbar,
    asking,
    clicking,
    opening,
    own_pictures,
    undoing,  # behind what shows what undo has left
    estimates,
    render_engine,
    operators,
    tools,
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


def __getattr__(name):
    if name == "headless":
        raise ImportError(
            "headless is now steps: import steps as karf, give each step the scene first, as in "
            "karf.set_swatch(scene, ..), and wait for those that learn or render: karf.learn_scene(scene).wait()."
        )
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
