"""KaRF: segment objects in a captured scene from rough masks, and recolor them by small palettes.

    import karf_engine as karf

    model = karf.learn("garden", masks="masks", preset="fast", project="garden_karf", progress=print)
    edit = model.edit().becomes("pot", "#b5302c", "#3059b8")
    picture = model.recolor(model.capture.view("r_003"), edit)

Importing this imports nothing else: each name is loaded on first use, and only learning and rendering need torch. The
functions are documented in `api`, the classes where they are defined.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .version import __version__

if TYPE_CHECKING:
    from .api import (
        colorways,
        convert_panoramas,
        erase_splats,
        export_page,
        export_splat,
        extract_palettes,
        find_poses,
        import_splat,
        inspect_capture,
        learn,
        learn_geometry,
        learn_recoloring,
        learn_splats,
        learning_bundle,
        load,
        mark,
        render,
        render_bundle,
        segment,
        write_points,
    )
    from .capture import open_capture
    from .capture.camera import Camera
    from .capture.camera_paths import camera_spline, orbit
    from .capture.capture import Capture, View
    from .errors import KarfError
    from .export.video import write_video
    from .palettes.color_books import ColorBook, nearest_names, read_color_book
    from .palettes.palette import Edit, Palette, read_edit, write_edit
    from .project.settings import PRESETS, Settings
    from .recolor.frames import Frame
    from .recolor.model import Model

# module -> the public names that it defines
_DEFINES = {
    "api": (
        "find_poses", "import_splat", "convert_panoramas", "inspect_capture", "mark",
        "learn", "learn_geometry", "segment", "extract_palettes", "learn_recoloring", "learn_splats",
        "erase_splats", "load",
        "render", "colorways", "write_points", "export_splat", "export_page", "render_bundle", "learning_bundle",
    ),
    "capture": ("open_capture",),
    "capture.camera": ("Camera",),
    "capture.camera_paths": ("orbit", "camera_spline"),
    "capture.capture": ("Capture", "View"),
    "errors": ("KarfError",),
    "export.video": ("write_video",),
    "palettes.palette": ("Edit", "Palette", "read_edit", "write_edit"),
    "palettes.color_books": ("ColorBook", "nearest_names", "read_color_book"),
    "project.settings": ("PRESETS", "Settings"),
    "recolor.frames": ("Frame",),
    "recolor.model": ("Model",),
}  # fmt: skip
_HOME = {name: module for module, names in _DEFINES.items() for name in names}

__all__ = sorted([*_HOME, "__version__"])  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_HOME[name]}", __name__), name)


def __dir__() -> list[str]:
    return __all__
