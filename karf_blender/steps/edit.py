"""Step 6: a color becomes another, a view is matched to a picture of it, edits are files, a chart tells the light."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..engine_api import (
    BadRequest,
    ChartFit,
    Edit,
    ObjectMatch,
    fit_photo,
    linear_to_srgb,
    read_edit_file,
    write_edit_file,
)
from ..host import windows
from ..pictures import editors, images
from ..project import captures
from ..swatches import colors, edits, matching
from ..swatches.solving import Becoming
from ..tasks import queries
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
        source: In the photos at their mean exposure, or `from_edited` in the edited picture.
        rule: `becomes` (the whole object gets a new paint) or `fewest` (as few changed swatches as possible).
        from_edited: Continue from the swatches as they are; else only locked ones stay as they are.
    """
    item = edits.object_named(scene, object_name)
    start = colors.edited(item) if from_edited else colors.learned(item)
    edits.become(item, Becoming(rgb_of(source), rgb_of(target), rule, start))


def paint_over(scene: bpy.types.Scene) -> bpy.types.Image:
    """Show a copy of the active view in the Image Editors, to be painted on."""
    image = matching.paint_over(scene)
    editors.reveal(image, is_wanted=True)
    editors.set_mode(image, "PAINT")
    return image


def match_picture(
    scene: bpy.types.Scene, picture: str | Path | bpy.types.Image | None = None
) -> tuple[ObjectMatch, ...]:
    """Set the swatches so that the active view matches a picture of it (None: the scene's own); locked ones stay.

    The picture is the whole view, of any size, without lens distortion. Returns those objects that it changes, with
    their mean CIEDE2000 to it `before` and `after`.
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


# --- files ---------------------------------------------------------------------------------------------------------
def apply_edit(scene: bpy.types.Scene, edit: str | Path | Edit) -> None:
    """Set the swatches to an edit, or to an edit or palette file; what it does not name becomes as learned."""
    if not isinstance(edit, Edit):
        edit = read_edit_file(Path(edit), colors.palettes(scene), scene.karf.compositing)
    edits.apply_edit(scene, edit)


def save_edit(scene: bpy.types.Scene, path: str | Path) -> None:
    """Write the swatches as an edit file, or as the palette file that the ending says."""
    write_edit_file(Path(path), edits.current_edit(scene))


# --- light of the photos -------------------------------------------------------------------------------------------
def pick_chart(scene: bpy.types.Scene, image: bpy.types.Image, corners: Sequence[tuple[float, float]]) -> ChartFit:
    """Read the light off a color chart of 24 patches (ColorChecker Classic) that a picture shows.

    Names, numbers and sheets of colorways are then those under daylight, as by a gray card, whose place it takes.

    Args:
        image: A photo with the light and the exposure of the capture's.
        corners: Of its block of patches, in order around it; from (0, 0), the picture's lower left corner, to (1, 1).
    """
    if not image.size[0]:
        raise BadRequest("{name} shows no picture.", "Open the photo of the chart.", name=image.name)
    pixels = images.pixels(image)[..., :3].astype(np.float64)
    photo = linear_to_srgb(pixels) if image.is_float else pixels
    across, up = np.transpose(corners)
    fit = fit_photo(np.clip(photo, 0, 1), np.stack([across * image.size[0], (1 - up) * image.size[1]], axis=-1))
    colors.set_chart(scene, fit.light.matrix, fit.mean_residual)
    return fit


def find_chart(scene: bpy.types.Scene, image: bpy.types.Image) -> None:
    """Find a color chart in a picture's file (KaRF's own: the view's photo) with the engine; see `pick_chart`."""
    if image.name.startswith(editors.PREFIX):
        photo = captures.view_of(scene).image
    else:
        photo = Path(bpy.path.abspath(image.filepath, library=image.library))
        if not image.filepath or not photo.is_file():
            raise BadRequest("{name} has no file.", "Save it, or click the corners of the chart.", name=image.name)
    queries.send(scene, "chart", {"photo": str(photo)}, _take_light)


def _take_light(scene: bpy.types.Scene, values: dict[str, Any]) -> None:
    colors.set_chart(scene, np.reshape(values["light"], (3, 3)), values["left"])
    if bpy.ops.ed.undo_push.poll():
        bpy.ops.ed.undo_push(message="Find Color Chart")
    windows.redraw()
