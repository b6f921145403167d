"""Step 6: one color becomes another, and edits as files."""

from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np

from ..engine_api import (
    Edit,
    match_becomes,
    match_fewest,
    nearest_weights,
    read_edit_file,
    read_object_colors,
    write_edit_file,
)
from ..project import folders
from ..swatches import colors, edits


def becomes(scene: bpy.types.Scene, name: str, source: Sequence[float], target: Sequence[float], rule: str) -> None:
    """Set an object's swatches so that a color of it becomes another; rule `becomes` or `fewest`. sRGB in [0, 1]."""
    item = edits.object_named(scene, name)
    project = folders.project_of(scene)
    seen, counts, palette_weights = read_object_colors(project.checked(project.object_colors_file), name)
    palette = colors.learned(item)
    locked = [index for index, swatch in enumerate(item.swatches) if swatch.locked]
    source, target = np.asarray(source, np.float32), np.asarray(target, np.float32)
    if rule == "fewest":
        weights = nearest_weights(seen, palette_weights, source)
        edited = match_fewest(weights, palette, target, locked, shown=source)
    else:
        edited = match_becomes(seen, counts, palette_weights, palette, source, target, locked)
    kept = colors.edited(item)
    edited[locked] = kept[locked]
    edits.apply_edit(scene, Edit({name: edited}, scene.karf.compositing))


def load_edit(scene: bpy.types.Scene, path: Path) -> None:
    """Set the swatches to an edit or palette file; what it does not name becomes as learned."""
    edits.apply_edit(scene, read_edit_file(path, edits.learned(scene), scene.karf.compositing))


def save_edit(scene: bpy.types.Scene, path: Path) -> None:
    """Write the swatches as an edit file, or as the palette file that the ending says."""
    write_edit_file(path, edits.current_edit(scene))
