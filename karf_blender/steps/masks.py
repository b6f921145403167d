"""Step 2: masks of objects, drawn on photos; and strokes that say where the segmentation is wrong.

A mask is written at once, as a step of Blender's undo. Places are pixels of the photo, y down. A mark adds ("ADD"), or
takes away ("TAKE"): of a correction, it says "this is it" or "this is not". "CLEAR" leaves a correction unsaid again.
"""

from collections.abc import Sequence

import bpy
import numpy as np

from .. import progress
from ..engine_api import BadRequest
from ..host import windows
from ..host.words import translatable
from ..marking import mask_layers, objects, photo, proposals, raster, tools
from ..marking.mask_layers import Layer
from ..marking.raster import Place
from ..pictures import editors
from ..preferences import state
from ..project import disk, folders
from ..workspace import following

WITHOUT_ENGINE = translatable("Brush, lasso and box work without it.")
CLICK_SHARE = 1 / 150  # radius of a correction's click, as a share of the photo's longer side


def show_photo(scene: bpy.types.Scene) -> bpy.types.Image:
    """Show the active view's photo with its masks, ready to mark; the first object is there already."""
    mask_layers.forget()  # another program may have written masks
    objects.sync(scene)
    if not scene.karf.marking.objects:
        objects.add(scene)
    image = photo.show(scene)
    photo.correct(scene)
    return image


def begin_marking(window: bpy.types.Window) -> None:
    """Show the photo to mark, or the picture of what is learned, in a window of the KaRF workspace. Never raises."""
    scene = window.scene
    if not scene.karf.project or disk.read(scene).stages:
        following.show_again()
        return
    with progress.printing_errors():  # nobody has asked for it
        show_photo(scene)
        with bpy.context.temp_override(window=window):
            for area in _photo_editors(window):
                tools.take_up(bpy.context, area)
            bpy.ops.ed.undo_push(message="Mark in Photo")  # else the next undo would take the object away


def fit_photo(window: bpy.types.Window) -> None:
    """Show the whole photo to mark, clear of the sidebar."""
    for area in _photo_editors(window):
        editors.fit(area)


def _photo_editors(window: bpy.types.Window) -> list[bpy.types.Area]:
    areas = [area for area in window.screen.areas if area.type == "IMAGE_EDITOR"]
    return [area for area in areas if photo.is_displayed(window.scene, area.spaces.active)]


def mark_stroke(scene: bpy.types.Scene, places: Sequence[Place], radius: float, does: str = "ADD") -> None:
    """Mark what a round brush of a radius in pixels covers. Marks raise OSError where none can be written."""
    layer = layer_to_mark(scene)
    for start, end in zip(places, [*places[1:], places[-1]], strict=True):
        raster.stroke(layer.pixels, start, end, radius, value_of(scene, does))
    keep(scene, layer)


def mark_lasso(scene: bpy.types.Scene, places: Sequence[Place], does: str = "ADD") -> None:
    """Mark what a closed line surrounds."""
    layer = layer_to_mark(scene)
    raster.polygon(layer.pixels, places, value_of(scene, does))
    keep(scene, layer)


def mark_box(scene: bpy.types.Scene, corner: Place, other: Place, does: str = "ADD") -> None:
    """Mark the object that the engine finds in a box. Without an engine, and to take away, the box itself counts."""
    if does == "ADD" and not scene.karf.marking.correct and not state.known().problem:
        middle, side = np.mean([corner, other], axis=0), np.abs(np.subtract(corner, other)).min()
        _begin_proposal(scene, middle, side / 4)
        proposals.propose(scene, proposals.box(scene, _name(scene), corner, other))
        return
    layer = layer_to_mark(scene)
    raster.box(layer.pixels, corner, other, value_of(scene, does))
    keep(scene, layer)


def mark_click(scene: bpy.types.Scene, place: Place, does: str = "ADD") -> None:
    """Mark what is under a click: the engine finds it; later clicks refine. In a correction it is a small dot."""
    radius = max(mask_layers.open_layers(scene).size) * CLICK_SHARE
    if scene.karf.marking.correct:
        mark_stroke(scene, [place], radius, does)
    elif problem := state.known().problem:
        raise BadRequest("Clicks need the engine.", f"{problem} {WITHOUT_ENGINE}")
    else:
        _begin_proposal(scene, place, radius)
        proposals.propose(scene, proposals.click(scene, _name(scene), place, does == "ADD"))


def _begin_proposal(scene: bpy.types.Scene, place: Place, radius: float) -> None:
    """Prepare for the engine's mask, which undo would bring back without the tint: that of the place is chosen now."""
    spot = np.zeros_like(layer_to_mark(scene).pixels)
    raster.stroke(spot, place, place, max(radius, 1), 1)  # at least one pixel
    photo.choose_tint(scene, spot)


def erase_mask(scene: bpy.types.Scene) -> None:
    """Remove the object's mask, or its correction, in the active view."""
    layer = layer_to_mark(scene)
    layer.pixels[:] = 0
    keep(scene, layer)


def layer_to_mark(scene: bpy.types.Scene) -> Layer:
    """Return what marks change: the object's mask in the active view, or its correction; `keep` writes it."""
    _choose_folder(scene)
    return mask_layers.open_layers(scene).layer(_name(scene), scene.karf.marking.correct)


def value_of(scene: bpy.types.Scene, does: str) -> int:
    """Return what a mark writes into the layer: 1, 0, or in a correction -1 for "this is not"."""
    return -1 if does == "TAKE" and scene.karf.marking.correct else int(does == "ADD")


def keep(scene: bpy.types.Scene, layer: Layer) -> None:
    layer.touch()
    if not scene.karf.marking.correct:
        photo.choose_tint(scene, layer.pixels)
    mask_layers.save(scene, _name(scene), scene.karf.marking.correct)
    disk.refresh()
    windows.redraw()
    photo.correct(scene)


def _name(scene: bpy.types.Scene) -> str:
    item = objects.active(scene)
    if item is None:
        raise BadRequest("There is no object to mark.", "Add one in the KaRF panel.")
    return item.folder


def _choose_folder(scene: bpy.types.Scene) -> None:
    if not scene.karf.masks:
        folders.store(scene, "masks", folders.project_of(scene).masks_folder)


def add_object(scene: bpy.types.Scene, name: str = objects.FIRST) -> str:
    """Add an object by a name as people type them; returns the name that its folder and its swatches get."""
    return objects.add(scene, name).folder


def remove_object(scene: bpy.types.Scene) -> None:
    """Remove the active object from the list, with its masks; raises OSError where a file cannot be removed."""
    _name(scene)
    objects.remove(scene)
    mask_layers.reread(scene)
    disk.refresh()


def go_to_view(scene: bpy.types.Scene, by: int, marked: bool = False) -> str:
    """Make the next (by 1) or previous (-1) view active, around the end, and return it; `marked`: with the object."""
    names = list(scene.karf.views.keys())
    wanted = set(objects.marked_views(scene)) if marked else set(names)
    start = names.index(scene.karf.active_view) if scene.karf.active_view in names else 0
    around = [names[(start + by * step) % len(names)] for step in range(1, len(names) + 1)]
    found = next((name for name in around if name in wanted), None)
    if found is None:
        raise BadRequest("This object is not marked in any view yet.", "Mark it in this view.")
    scene.karf.active_view = found
    return found


def go_to_suggested(scene: bpy.types.Scene) -> str:
    """Make the view active whose mark would decide most, or called again, the next best; returns its name."""
    names = disk.read(scene).suggested
    if not names:
        raise BadRequest("No view is suggested.", "Segment first.")
    active = scene.karf.active_view
    scene.karf.active_view = names[(names.index(active) + 1) % len(names) if active in names else 0]
    return scene.karf.active_view


def set_volume(scene: bpy.types.Scene, shape: bpy.types.Object | None, kind: str) -> int:
    """Put the active object `inside` or `outside` of a mesh or Empty's box (None: forget them); return their number."""
    count = objects.set_volume(scene, _name(scene), shape, kind)
    photo.correct(scene)
    return count
