"""Swatches, the view that shows them, and the .blend that keeps them."""

from collections.abc import Sequence
from pathlib import Path

import bpy

from .. import steps
from ..engine_api import REACH, Edit, ObjectMatch, hex_to_rgb
from ..swatches import edits
from ..tasks import runner
from .context import scene_of

Color = str | Sequence[float]


def set_swatch(object_name: str, index: int, color: Color, scene: bpy.types.Scene | None = None) -> None:
    """Give a swatch a color.

    Args:
        object_name: Name of the object.
        index: Number of the swatch, from 1: swatch 0 is black and frozen.
        color: sRGB in [0, 2], or "#rrggbb".
        scene: Default: the context's.
    """
    edits.set_color(scene_of(scene), object_name, index, _color(color))


def becomes(
    object_name: str,
    source: Color,
    target: Color,
    rule: str = "becomes",
    from_edited: bool = False,
    scene: bpy.types.Scene | None = None,
) -> None:
    """Set an object's swatches so that one color of it becomes another.

    Args:
        object_name: Name of the object.
        source: A color of the object as it is in the photos: sRGB in [0, 1], or "#rrggbb".
        target: What it shall become.
        rule: `becomes` (the whole object gets a new paint) or `fewest` (as few changed swatches as possible).
        from_edited: The source is a color of the edited picture, and the edit goes on from there.
        scene: Default: the context's.
    """
    steps.becomes(scene_of(scene), object_name, _color(source), _color(target), rule, from_edited)


def match_picture(
    picture: str | Path | bpy.types.Image, view: str = "", scene: bpy.types.Scene | None = None
) -> tuple[ObjectMatch, ...]:
    """Set the swatches so that a view looks as a painted or graded picture of it does; locked swatches stay.

    Args:
        picture: A file or an image: the whole view, of any size, without lens distortion.
        view: Name of the view, which is prepared where needed; default: the active one.
        scene: Default: the context's.

    Returns:
        For each object that the picture wants otherwise: its `name`, its `colors`, and the mean CIEDE2000 of its pixels
        to the picture `before` and what is `left`.
    """
    show_view(view, scene)
    return steps.match_picture(scene_of(scene), Path(picture) if isinstance(picture, str) else picture)


def link_swatches(one: tuple[str, int], other: tuple[str, int], scene: bpy.types.Scene | None = None) -> None:
    """Give one swatch, an object's name and a number from 1, the other's color, and let both have one from now on."""
    steps.link_swatches(scene_of(scene), one, other)


def merge_swatch(object_name: str, index: int, into: int | None = None, scene: bpy.types.Scene | None = None) -> int:
    """Let one swatch of an object (default: that of the nearest learned color) move another too; returns its number."""
    return steps.merge_swatch(scene_of(scene), object_name, index, into)


def add_color(
    object_name: str,
    picked: Color,
    color: Color | None = None,
    reach: float = REACH,
    scene: bpy.types.Scene | None = None,
) -> int:
    """Give an object one more swatch, which changes only what has the pigment of a color that it shows.

    Args:
        object_name: Name of the object.
        picked: A color of the object as the photos show it: sRGB in [0, 1], or "#rrggbb".
        color: What it shall be; default: as it is shown now.
        reach: How far around its hue (of a gray: its chroma) colors are of this pigment, 0.05 to 4.
        scene: Default: the context's.

    Returns:
        The swatch's number, for `set_swatch`.
    """
    number = steps.add_color(scene_of(scene), object_name, _color(picked), reach)
    if color is not None:
        set_swatch(object_name, number, color, scene)
    return number


def remove_color(object_name: str, index: int, scene: bpy.types.Scene | None = None) -> None:
    """Take a color away that was added to an object."""
    steps.remove_color(scene_of(scene), object_name, index)


def apply_edit(edit: str | Path | Edit, scene: bpy.types.Scene | None = None) -> None:
    """Set the swatches to an edit, or to that in an edit file."""
    if isinstance(edit, Edit):
        edits.apply_edit(scene_of(scene), edit)
    else:
        steps.load_edit(scene_of(scene), Path(edit))


def save_edit(path: str | Path, scene: bpy.types.Scene | None = None) -> None:
    """Write the swatches as an edit file."""
    steps.save_edit(scene_of(scene), Path(path))


def show_view(view: str = "", scene: bpy.types.Scene | None = None) -> bpy.types.Image:
    """Show a captured view recolored, preparing it where needed.

    Args:
        view: Name of the view; default: the active one.
        scene: Default: the context's.

    Returns:
        The result image.
    """
    task = steps.show_view(scene_of(scene), view)
    if task is not None:
        runner.wait(task)
    return scene_of(scene).karf.result


def prepare_views(views: str = "all", scene: bpy.types.Scene | None = None) -> None:
    """Prepare captured views (`all`, `train`, `test` or names), so that they show without the engine."""
    runner.wait(steps.prepare_views(scene_of(scene), views))


def save(path: str | Path | None = None) -> None:
    """Save the .blend (at `path`, else where it is)."""
    if path is None:
        bpy.ops.wm.save_mainfile()
    else:
        bpy.ops.wm.save_as_mainfile(filepath=str(Path(path).absolute()))


def _color(color: Color) -> Sequence[float]:
    return hex_to_rgb(color) if isinstance(color, str) else color
