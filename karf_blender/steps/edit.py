"""Step 6: one color becomes another, a view is matched to a picture of it, and edits are kept as files."""

from pathlib import Path

import bpy

from ..engine_api import Edit, ObjectMatch, read_edit_file, write_edit_file
from ..pictures import editors
from ..swatches import becomes as becoming
from ..swatches import colors, edits, matching
from ..swatches.solving import Becoming
from .swatches import Color, rgb_of


def becomes(
    scene: bpy.types.Scene,
    object_name: str,
    source: Color,
    target: Color,
    rule: str = "becomes",
    from_edited: bool = False,
) -> None:
    """Set an object's swatches so that a color of it becomes another.

    Args:
        scene: The scene.
        object_name: The object's.
        source: As the photos show it in their mean exposure, or `from_edited` as the edited picture does.
        target: What it shall become.
        rule: `becomes` (the whole object gets a new paint) or `fewest` (as few changed swatches as possible).
        from_edited: Continue from the swatches as they are; else only locked ones stay as they are.
    """
    item = edits.object_named(scene, object_name)
    start = colors.edited(item) if from_edited else colors.learned(item)
    becoming.apply(item, Becoming(rgb_of(source), rgb_of(target), rule, start))


def paint_over(scene: bpy.types.Scene) -> bpy.types.Image:
    """Show a copy of the active view in the Image Editors, to be painted on."""
    image = matching.paint_over(scene)
    editors.reveal(image, is_wanted=True)
    editors.set_mode(image, "PAINT")
    return image


def match_picture(
    scene: bpy.types.Scene, picture: str | Path | bpy.types.Image | None = None
) -> tuple[ObjectMatch, ...]:
    """Set the swatches so that the active view looks as a picture of it does; locked ones stay.

    Args:
        scene: The scene.
        picture: A file or an image: the whole view, of any size, without lens distortion; None: the scene's own.

    Returns:
        For each object that the picture wants otherwise: its `name`, its `colors`, and the mean CIEDE2000 of its pixels
        to the picture `before` and what is `left`.

    Raises:
        BadRequest: There is no picture, or it is not of this view.
        DataError: The file is unreadable.
    """
    if isinstance(picture, str | Path):
        found = matching.match(scene, Path(picture).name, matching.read(Path(picture)))
    else:
        image = picture or matching.chosen(scene)
        found = matching.match(scene, image.name, matching.pixels_of(image))
    scene.karf.match.left.clear()
    for each in found:
        left = scene.karf.match.left.add()
        left.name, left.before, left.left = each.name, each.before, each.after
    return found


def apply_edit(scene: bpy.types.Scene, edit: str | Path | Edit) -> None:
    """Set the swatches to an edit, or to an edit or palette file; what it does not name becomes as learned."""
    if not isinstance(edit, Edit):
        edit = read_edit_file(Path(edit), colors.palettes(scene), scene.karf.compositing)
    edits.apply_edit(scene, edit)


def save_edit(scene: bpy.types.Scene, path: str | Path) -> None:
    """Write the swatches as an edit file, or as the palette file that the ending says."""
    write_edit_file(Path(path), edits.current_edit(scene))
