"""Live Camera: what the scene's camera sees, rendered by the engine while it or the rig moves.

A coarse picture comes first, finer ones while the camera stands still. One timer compares the camera, so that anything
that moves it counts. While no editor shows the picture, nothing is rendered.
"""

import json
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import bpy

from .. import session
from ..engine_api import BadRequest, Camera, KarfError, camera_to_json, read_planes
from ..host import rendering, windows
from ..host.words import translatable
from ..pictures import editors, images
from ..render_engine import camera_pixels
from ..rig import lens
from ..swatches import colors, displayed, views
from ..swatches.views import DisplayedView
from ..tasks import queries, runner
from ..tasks.runner import Owner
from .render import camera_of

NO_PHOTO = translatable("A free camera has no photo: Original shows the learned scene.")
NO_PALETTES = translatable(
    "There are no palettes yet, so the picture shows the learned scene. Press Extract Palette in step 3."
)
NO_MASKS = translatable("Nothing is segmented yet, so there are no masks to show. Press Segment in step 3.")
UNSEEN = translatable("The picture KaRF camera is only rendered while an Image Editor shows it. Choose it in one.")
KIND = "preview"
COARSE_SIDE = 96  # pixels
TICK_SECONDS = 0.03

Wanted = tuple[str, int]  # `_Live.text`, and the picture's long side


@dataclass
class _Live:
    """The followed camera and its picture."""

    owner: Owner  # its scene
    camera: Camera | None = None  # as it was seen last
    text: str = ""  # what the picture depends on but swatches, as a comparable text
    sides: tuple[int, ...] = ()  # long sides of the pictures that are still to be requested
    requested: Wanted | None = None
    view: DisplayedView | None = None  # the planes that came last
    edit: tuple = ()  # the swatches and the display options that they are shown with
    message: str = "The engine starts"  # why the picture is missing; empty where it is there
    is_displayed: bool = True  # by an editor


class _State:
    live: _Live | None = None  # where a camera is followed


def is_live() -> bool:
    return session.get(_State).live is not None


def message() -> str:
    """Why the followed camera has no picture, or an old one; empty where it has one."""
    live = session.get(_State).live
    if live is None:
        return ""
    return live.message if live.is_displayed else UNSEEN


def missing() -> tuple[str, ...]:
    """Return what the settings ask for and the picture cannot show, a sentence each."""
    view, seeing = displayed.followed_camera(), bpy.data.window_managers[0].karf_seeing
    if view is None:
        return ()
    wants_palettes = seeing.mode in {"WEIGHTS", "DIFFERENCE"}
    found = {
        NO_PHOTO: seeing.mode == "ORIGINAL" or seeing.is_wiped,
        NO_PALETTES: wants_palettes and not view.planes.palette_weights.shape[1],
        NO_MASKS: seeing.show_masks and not view.planes.objects,
    }
    return tuple(sentence for sentence, is_missing in found.items() if is_missing)


def start(scene: bpy.types.Scene) -> None:
    """Follow the scene's camera, whose picture is shown in the Image Editors that are free."""
    if bpy.app.background:
        raise BadRequest("Live Camera needs a window.", "Write a picture instead: steps.preview_camera.")
    camera_of(scene, None)
    image = displayed.camera_image()
    if image is not None:
        editors.reveal(image, is_wanted=True, is_whole=True)
    session.get(_State).live = _Live(Owner.of(scene))
    session.start_timer(_tick, persistent=True)


def stop() -> None:
    """Follow no camera; its last picture stays."""
    session.get(_State).live = None
    displayed.follow_no_camera()


def preview_camera(
    scene: bpy.types.Scene, path: str | Path, camera: bpy.types.Object | None = None, long_side: int = 512
) -> Path:
    """Write a PNG of what a camera (default: the scene's) sees now with the swatches as they are; return its path.

    The picture is never larger than the scene's render size. The worker that renders it stays for the next one.
    """
    pinhole = lens.pinhole(scene, camera_of(scene, camera))
    view = _taken(queries.wait(scene, KIND, _options(scene, pinhole, long_side)))
    images.write_png(Path(path), images.upright(view.recolored(scene)))
    return Path(path)


def _options(scene: bpy.types.Scene, camera: Camera, long_side: int) -> dict[str, Any]:
    return {"camera": camera_to_json(camera), "long_side": long_side, "unseen": camera_pixels.unseen(scene)}


def _taken(answer: dict[str, Any]) -> DisplayedView:
    """The planes of an answer, whose file is removed."""
    file = Path(answer["planes"])
    try:
        return DisplayedView(file, 0, read_planes(file), is_free=True)
    finally:
        with suppress(OSError):
            file.unlink()


def _tick() -> float | None:
    """The timer: follows camera and swatches, and ends itself when no camera is followed."""
    live = session.get(_State).live
    scene = live.owner.find() if live else None
    if scene is None:
        stop()
        windows.redraw()
        return None
    before = message()
    image = displayed.camera_image()
    if image is None:  # it is not there yet, or undo took it: it is shown when made
        live.edit = ()
    live.is_displayed = image is None or editors.is_shown(image)
    if not rendering.is_over() or runner.is_running():
        live.text = ""  # what a task learns changes the picture, and meanwhile the cores are its own
    elif live.is_displayed:
        try:
            _follow_camera(live, scene)
            if live.view is not None and _edit_key(scene) != live.edit:
                _show(live, scene)
        except KarfError as error:
            _say(live, error)
    if message() != before:
        windows.redraw()
    return TICK_SECONDS


def _follow_camera(live: _Live, scene: bpy.types.Scene) -> None:
    """Ask for the next picture: the coarse one of a camera that has moved, else a finer one."""
    if live.requested is not None and live.requested[1] == COARSE_SIDE:
        return  # it is let through: else nothing would be seen as long as the camera moves
    try:
        camera = lens.pinhole(scene, camera_of(scene, None))
    except KarfError:
        live.text = ""  # as soon as there is a camera again, its picture is wanted
        raise
    full = bpy.data.window_managers[0].karf_preview.long_side
    text = json.dumps([camera_to_json(camera), full, scene.karf.fade_unseen])
    if text != live.text:
        finer = sorted(side for side in {full // 2, full} if side > COARSE_SIDE)
        live.camera, live.text, live.sides, live.requested = camera.reduced(full), text, (COARSE_SIDE, *finer), None
    if live.sides and live.requested is None:
        side, *rest = live.sides
        live.sides, live.requested = tuple(rest), (text, side)
        on_answer, on_error = partial(_take, live.requested), lambda error: _say(session.get(_State).live, error)
        queries.send(scene, KIND, _options(scene, camera, side), on_answer, on_error)


def _take(requested: Wanted, scene: bpy.types.Scene, answer: dict[str, Any]) -> None:
    """Show an answer, unless another camera is wanted by now."""
    view, live = _taken(answer), session.get(_State).live
    if live is None or live.requested != requested:
        return
    live.requested, live.view, live.message = None, view, ""
    _show(live, scene)


def _show(live: _Live, scene: bpy.types.Scene) -> None:
    live.edit = _edit_key(scene)
    displayed.show_camera(scene, live.view, live.camera.width, live.camera.height)


def _edit_key(scene: bpy.types.Scene) -> tuple:
    edited = [colors.edited(item).tobytes() for item in scene.karf.objects]
    added = [colors.keys(own) for own in colors.added_by_object(scene).values()]
    return scene.karf.compositing, *views.key(), *edited, added, colors.edges(scene)


def _say(live: _Live | None, error: KarfError) -> None:
    """Say why the picture is missing; it is requested again when the camera moves."""
    if live is not None:
        live.message, live.requested, live.sides = error.message, None, ()


@session.handler("save_pre")
def _before_save(*_):
    images.pack(displayed.camera_image())  # pixels that are only in memory are not saved
