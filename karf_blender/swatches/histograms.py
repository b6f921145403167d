"""The colors that objects have in the photos, read once from the project."""

from pathlib import Path

import bpy

from ..engine_api import ColorHistogram, read_object_colors
from ..project import folders


class _Memory:
    """The histograms read last, of one file: its path and time, and what each object's is."""

    source: tuple[Path, int] | None = None
    histograms: dict[str, ColorHistogram] = {}


def of(scene: bpy.types.Scene, name: str) -> ColorHistogram:
    """An object's colors, read once.

    Raises:
        KarfError: There is no project, or it is damaged or has no such object.
    """
    project = folders.project_of(scene)
    file = project.object_colors_file
    source = file, file.stat().st_mtime_ns if file.exists() else 0
    if _Memory.source != source:
        _Memory.source, _Memory.histograms = source, {}
    if name not in _Memory.histograms:
        _Memory.histograms[name] = read_object_colors(project.checked(file), name)
    return _Memory.histograms[name]
