"""Step 6: one color becomes another, a view is matched to a picture of it, and edits are kept as files."""

from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np

from ..engine_api import ObjectMatch, read_edit_file, write_edit_file
from ..pictures import editors
from ..swatches import becomes as becoming
from ..swatches import colors, edits, matching


def becomes(
    scene: bpy.types.Scene,
    name: str,
    source: Sequence[float],
    target: Sequence[float],
    rule: str,
    from_edited: bool = False,
) -> None:
    """Set an object's swatches so that a color of it becomes another.

    Args:
        scene: The scene.
        name: The object's.
        source: sRGB in [0, 1], as the photos show it, or `from_edited` as the edited picture does.
        target: What it shall become.
        rule: `becomes` or `fewest`.
        from_edited: Go on from the swatches as they are; else only locked ones stay as they are.
    """
    item = edits.object_named(scene, name)
    start = colors.edited(item) if from_edited else colors.learned(item)
    becoming.apply(scene, name, np.array(source, np.float32), np.array(target, np.float32), rule, start)


def paint_over(scene: bpy.types.Scene) -> bpy.types.Image:
    """Show a copy of the active view in the Image Editors, to be painted on."""
    image = matching.paint_over(scene)
    editors.reveal(image, is_wanted=True)
    editors.set_mode(image, "PAINT")
    return image


def match_picture(scene: bpy.types.Scene, picture: Path | bpy.types.Image | None = None) -> tuple[ObjectMatch, ...]:
    """Set the swatches so that the active view looks as a picture of it does; locked ones stay.

    Args:
        scene: The scene.
        picture: A file or an image; None: the scene's own.

    Returns:
        What came of each object that the picture wants otherwise.

    Raises:
        BadRequest: There is no picture, or it is not of this view.
        DataError: The file is unreadable.
    """
    if isinstance(picture, Path):
        found = matching.match(scene, picture.name, matching.read(picture))
    else:
        image = picture or matching.chosen(scene)
        found = matching.match(scene, image.name, matching.pixels_of(image))
    scene.karf.match.left.clear()
    for each in found:
        left = scene.karf.match.left.add()
        left.name, left.before, left.left = each.name, each.before, each.left
    return found


def load_edit(scene: bpy.types.Scene, path: Path) -> None:
    """Set the swatches to an edit or palette file; what it does not name becomes as learned."""
    edits.apply_edit(scene, read_edit_file(path, edits.learned(scene), scene.karf.compositing))


def save_edit(scene: bpy.types.Scene, path: Path) -> None:
    """Write the swatches as an edit file, or as the palette file that the ending says."""
    write_edit_file(path, edits.current_edit(scene))
