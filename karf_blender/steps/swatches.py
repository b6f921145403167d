"""Step 4: swatches and edits. A swatch is an object's name and a number from 1: swatch 0 is black."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..engine_api import (
    MAX_ADDED,
    AddedColor,
    BadRequest,
    ChartFit,
    ColorBook,
    Edit,
    ObjectMatch,
    Surface,
    ciede2000,
    fit_photo,
    hex_to_rgb,
    linear_to_srgb,
    propose_added_color,
    read_edit_file,
    rgb_to_hex,
    srgb_to_lab,
    write_edit_file,
)
from ..host import windows
from ..pictures import editors, images
from ..project import captures
from ..swatches import colors, displayed, edits, gestures, groups, keyframes, matching
from ..swatches.solving import Becoming
from ..tasks import queries

ROUNDING = 0.1  # CIEDE2000 that colors in float32 and tables with few digits are off
Swatch = tuple[str, int]
Color = str | Sequence[float]  # sRGB in [0, 1], or "#rrggbb"


def rgb_of(color: Color) -> np.ndarray:
    """A color as sRGB, float32 [3]."""
    return np.array(hex_to_rgb(color) if isinstance(color, str) else color, np.float32)


def set_swatch(scene: bpy.types.Scene, object_name: str, index: int, color: Color) -> None:
    """Give one swatch a color, sRGB in [0, 2]; its paint's other swatches stay."""
    with displayed.batched(scene):
        edits.set_color(scene, object_name, index, rgb_of(color))


def use_color_name(scene: bpy.types.Scene, object_name: str, index: int, book: ColorBook, name: str) -> float:
    """Give one swatch (0: the target color) a named color; return how far pictures miss it (CIEDE2000), or 0."""
    color = colors.as_photographed(scene, book[name])
    if index:
        edits.set_color(scene, object_name, index, color)
    else:
        edits.object_named(scene, object_name).target = color = np.minimum(color, 1)
    left = float(ciede2000(srgb_to_lab(colors.as_named(scene, color)), book.lab_of(name)))
    return left if left > ROUNDING else 0.0


def set_surface(
    scene: bpy.types.Scene,
    object_name: str,
    index: int,
    saturation: float = 1.0,
    brightness: float = 0.0,
    gloss: float = 1.0,
) -> None:
    """Set the surface of a swatch and of those linked: saturation 0 to 4, brightness -2 to 2, gloss 0 (matte) to 4."""
    with displayed.batched(scene):
        colors.write_surface(edits.unlocked(scene, object_name, index), Surface(saturation, brightness, gloss))


def link_swatches(scene: bpy.types.Scene, one: Swatch, other: Swatch) -> None:
    """Give one swatch the other's color, and let both, and what each was linked to, have one color from now on."""
    first, second = edits.unlocked(scene, *one), edits.swatch_at(scene, *other)
    if first == second or second.merged:
        raise BadRequest(
            "Swatch {index} of {name!r} cannot be linked with that swatch.",
            "Choose another swatch.",
            index=one[1],
            name=one[0],
        )
    with displayed.batched(scene):
        groups.link(first, second)


def unlink_swatch(scene: bpy.types.Scene, name: str, index: int) -> None:
    """Unlink a swatch from all others; its color stays."""
    groups.unlink(edits.swatch_at(scene, name, index))


def merge_swatch(scene: bpy.types.Scene, object_name: str, index: int, into: int | None = None) -> int:
    """Merge a swatch `into` another of its object, default: that with the nearest learned color; return its number."""
    edits.unlocked(scene, object_name, index)
    item, which = edits.object_named(scene, object_name), {"index": index, "name": object_name}
    others = [each for each in range(1, colors.size(item)) if each != index and not item.swatches[each].merged]
    if item.swatches[index].is_added:
        raise BadRequest(
            "Swatch {index} of {name!r} is an added color and cannot be merged.", "Remove it in its menu.", **which
        )
    if not others or into not in (None, *others):
        raise BadRequest(
            "Swatch {index} of {name!r} cannot be merged into {other}.",
            "Choose another visible swatch of this object.",
            **which,
            other=into or "another",
        )
    if into is None:
        lab = srgb_to_lab(colors.learned(item))
        into = min(others, key=lambda other: float(np.linalg.norm(lab[other] - lab[index])))
    with displayed.batched(scene):
        groups.merge(item, index, into)
    return into


def split_swatch(scene: bpy.types.Scene, name: str, index: int) -> None:
    """Split a swatch from those merged into it; colors stay."""
    if edits.swatch_at(scene, name, index).is_added:
        raise BadRequest(
            "Swatch {index} of {name!r} is an added color and has no merged swatches.",
            "Remove it in its menu.",
            index=index,
            name=name,
        )
    groups.split(edits.object_named(scene, name), index)


def color_at(scene: bpy.types.Scene, name: str, place: tuple[float, float]) -> np.ndarray:
    """Return an object's learned color, sRGB [3], at a place of the active view, (0, 0) lower left to (1, 1)."""
    view = displayed.of(scene).prepared_view().planes
    learned = colors.state(edits.object_named(scene, name)).palette.colors
    height, width = view.base.shape[:2]
    column, row = int(place[0] * width), int((1 - place[1]) * height)
    near = slice(max(0, row - 1), row + 2), slice(max(0, column - 1), column + 2)
    weights = view.palette_weights[view.objects.index(name)][: len(learned), *near].reshape(len(learned), -1)
    own = weights.sum(axis=1, dtype=np.float32)
    if not (0 <= row < height and 0 <= column < width) or own.sum() < weights.shape[1] / 2:
        raise BadRequest(
            "{name!r} is not at this place in {view!r}.",
            "Click on it in the picture.",
            name=name,
            view=scene.karf.active_view,
        )
    return np.clip(own / own.sum() @ learned, 0, 1)


def add_color(
    scene: bpy.types.Scene,
    object_name: str,
    picked: Color,
    color: Color | None = None,
    reach: float | None = None,
    protect: float | None = None,
) -> int:
    """Give an object one more swatch for the pigment of the `picked` color, as the photos show it; return its number.

    The swatch gets a `color`; default: as it is shown now. The `reach`, 0.05 to 4, is how far around its hue (of a
    gray: its chroma) colors are of this pigment; see `edit.added`. Colors under the share `protect`, 0 to 0.5, of its
    saturation are neutral and not of it. Both default to what the object's colors propose.
    """
    item, picked = edits.object_named(scene, object_name), rgb_of(picked)
    if len(colors.added(item)) >= MAX_ADDED:
        raise BadRequest(
            "{name!r} already has {count} added colors.",
            "Remove one of them in its menu.",
            count=MAX_ADDED,
            name=object_name,
        )
    likely = propose_added_color(displayed.of(scene).learned_histogram(object_name), picked)
    added = AddedColor(picked, likely.reach if reach is None else reach, likely.protect if protect is None else protect)
    with displayed.batched(scene):
        number = groups.add_color(item, added, groups.first_set(item, added))
    if color is not None:
        set_swatch(scene, object_name, number, color)
    return number


def remove_color(scene: bpy.types.Scene, object_name: str, index: int) -> None:
    """Take an added color away: its pigment is the swatches' again."""
    swatch, item = edits.unlocked(scene, object_name, index), edits.object_named(scene, object_name)
    if not swatch.is_added:
        raise BadRequest(
            "Swatch {index} of {name!r} is a learned color and cannot be removed.",
            "Merge it into another swatch in its menu.",
            index=index,
            name=object_name,
        )
    keyframes.copy_shared_action(scene)
    curves, count, learned = keyframes.of(scene), colors.size(item), rgb_to_hex(swatch.learned)
    with displayed.batched(scene), gestures.suspended(scene):
        groups.unlink(swatch)
        groups.remove_color(item, index)
    numbers = {each: number for number, each in enumerate(scene.karf.objects.keys())}
    for curve in curves:
        if curve.object_name == object_name and isinstance(curve.swatch, int) and curve.swatch >= index:
            keyframes.move(curve, numbers, learned if curve.swatch == index else curve.swatch - count)


# --- colors and pictures -------------------------------------------------------------------------------------------
def becomes(
    scene: bpy.types.Scene,
    object_name: str,
    source: Color,
    target: Color,
    rule: str = "becomes",
    from_edited: bool = False,
) -> None:
    """Set an object's swatches so that a color, in the photos or `from_edited` in the edited picture, becomes another.

    The rule is `becomes` (the whole object), `paint` (this paint alone) or `fewest` (as few swatches as possible). It
    starts from the swatches as they are if `from_edited`; else only locked ones stay as they are.
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

    It is the whole view, of any size, undistorted. Returns changed objects with CIEDE2000 `before` and `after`.
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
    """Read the light off a color chart of 24 patches (ColorChecker Classic) in a photo with the capture's exposure.

    Names, numbers and sheets of colorways are then those under daylight, as by a gray card, whose place it takes. The
    `corners` of its block of patches go around it, from (0, 0), the picture's lower left corner, to (1, 1).
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
