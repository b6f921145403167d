"""KaRF: segment objects in a captured scene from rough masks, and recolor them by small palettes.

    import karf_engine as karf

    model = karf.learn("garden", masks="masks", preset="fast", project="garden_karf", progress=print)
    edit = model.edit().becomes("pot", "#b5302c", "#3059b8")
    picture = model.recolor(model.capture.view("r_003"), edit)

Importing this imports nothing else: each name is loaded when it is first used, and only what learns or renders needs
torch. The functions are documented in `api`, the rest where it is defined.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .version import __version__

if TYPE_CHECKING:
    from .api import (
        colorways,
        extract_palettes,
        find_poses,
        learn,
        learn_geometry,
        learn_recoloring,
        load,
        mark,
        render,
        segment,
        write_points,
    )
    from .capture import open_capture
    from .capture.camera import Camera
    from .capture.capture import Capture, View
    from .commands.farm.bundle import learning_bundle, render_bundle
    from .errors import KarfError
    from .palettes.edit_files import read_edit, write_edit
    from .palettes.palette import Edit, Palette
    from .project.settings import PRESETS, Settings
    from .recolor.frames import Frame
    from .recolor.model import Model

_HOME = {  # name -> the module that defines it
    "Camera": "capture.camera",
    "Capture": "capture.capture",
    "Edit": "palettes.palette",
    "Frame": "recolor.frames",
    "KarfError": "errors",
    "Model": "recolor.model",
    "PRESETS": "project.settings",
    "Palette": "palettes.palette",
    "Settings": "project.settings",
    "View": "capture.capture",
    "colorways": "api",
    "extract_palettes": "api",
    "find_poses": "api",
    "learn": "api",
    "learn_geometry": "api",
    "learn_recoloring": "api",
    "learning_bundle": "commands.farm.bundle",
    "load": "api",
    "mark": "api",
    "open_capture": "capture",
    "read_edit": "palettes.edit_files",
    "render": "api",
    "render_bundle": "commands.farm.bundle",
    "segment": "api",
    "write_edit": "palettes.edit_files",
    "write_points": "api",
}

__all__ = [
    "PRESETS",
    "Camera",
    "Capture",
    "Edit",
    "Frame",
    "KarfError",
    "Model",
    "Palette",
    "Settings",
    "View",
    "__version__",
    "colorways",
    "extract_palettes",
    "find_poses",
    "learn",
    "learn_geometry",
    "learn_recoloring",
    "learning_bundle",
    "load",
    "mark",
    "open_capture",
    "read_edit",
    "render",
    "render_bundle",
    "segment",
    "write_edit",
    "write_points",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_HOME[name]}", __name__), name)


def __dir__() -> list[str]:
    return __all__
