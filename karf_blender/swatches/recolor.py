"""Keeps every scene's result image up to date with its swatches.

The image follows swatch edits (property updates), undo and redo, keyframes (frame changes), drivers (dependency graph
updates) and loaded files; while Blender renders it waits, and follows when that ends.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ..engine_api import KarfError
from ..host import handlers, rendering
from ..pictures import images
from . import colors, display, object_masks, planes, wishes

RESULT_NAME = "KaRF"
RETRY_SECONDS = 0.2


class _Memory:
    """Of each scene (by `session_uid`) the values that its picture was made from, and what a stand-in would be of.

    `open_batches` counts the `batched` blocks that are open.
    """

    values: dict[int, bytes] = {}
    shown: dict[int, tuple] = {}
    open_batches: int = 0


def forget() -> None:
    """Drop what is in memory of planes and pictures."""
    for module in (planes, display, object_masks, wishes):
        module.forget()
    _Memory.values.clear()


# --- the picture ---------------------------------------------------------------------------------------------------
def show(scene: bpy.types.Scene) -> bpy.types.Image:
    """Put the active view, as it is looked at, into the scene's result image, which is made if needed.

    Raises:
        KarfError: The view cannot be composited, or Blender renders.
    """
    rendering.refuse()
    _Memory.values[scene.session_uid] = _values(scene)
    return _put(scene, display.picture(scene))


def _put(scene: bpy.types.Scene, buffer: np.ndarray) -> bpy.types.Image:
    """Make an RGBA buffer [H, W, 4] the scene's result image, as the active view's picture."""
    height, width = buffer.shape[:2]
    if scene.karf.result is None:
        scene.karf.result = images.new_image(RESULT_NAME, width, height)
    images.fit(scene.karf.result, width, height)
    images.upload(scene.karf.result, buffer)
    _Memory.shown[scene.session_uid] = display.stand_in_key(scene)
    object_masks.load(scene)
    wishes.update(scene)
    return scene.karf.result


def refresh(scene: bpy.types.Scene) -> None:
    """Bring the result image up to date after a change, where there is one to show; never raises.

    A view that cannot be shown recolored shows its photo instead: never another view's picture.
    """
    if rendering.is_running():
        _refresh_later()
        return
    if _Memory.open_batches or scene.karf.result is None:
        return
    try:
        show(scene)
    except KarfError:  # the panel says that the view is not prepared
        if _Memory.shown.get(scene.session_uid) != display.stand_in_key(scene):
            show_unedited(scene)


def show_unedited(scene: bpy.types.Scene) -> bpy.types.Image:
    """Put what there is of a view that cannot be recolored into the scene's result image, which is made if needed.

    Raises:
        BadRequest: Blender renders.
    """
    rendering.refuse()
    return _put(scene, display.stand_in(scene))


def _refresh_changed() -> None:
    """Bring the pictures of all scenes up to date whose values have changed since."""
    for scene in bpy.data.scenes:
        if scene.karf.result is not None and _values(scene) != _Memory.values.get(scene.session_uid):
            refresh(scene)


def _refresh_later() -> None:
    # in background mode timers never fire; there a render's last handler follows
    if not bpy.app.background and not bpy.app.timers.is_registered(_catch_up):
        bpy.app.timers.register(_catch_up, first_interval=RETRY_SECONDS)


def _catch_up() -> float | None:
    """The timer: waits until Blender has rendered."""
    if not rendering.is_over():
        return RETRY_SECONDS
    _refresh_changed()
    return None


@contextmanager
def batched(scene: bpy.types.Scene) -> Iterator[None]:
    """Change many swatches inside this block and get one new picture at its end."""
    _Memory.open_batches += 1
    try:
        yield
    finally:
        _Memory.open_batches -= 1
    refresh(scene)


def _values(scene: bpy.types.Scene) -> bytes:
    """All that keyframes can change in a picture, as one comparable value."""
    palettes = [colors.edited(item).tobytes() for item in scene.karf.objects]
    return b"".join([scene.karf.compositing.encode(), scene.karf.active_view.encode(), *palettes])


# --- handlers ------------------------------------------------------------------------------------------------------
@persistent
def _after_undo(*_):
    # undo takes swatches back, but neither pixels nor update callbacks
    refresh(bpy.context.scene)


@persistent
def _after_change(*_):
    # animated and driven swatches change without their update callback; a render job calls this on its own thread
    if not rendering.is_running():
        _refresh_changed()


@persistent
def _after_load(*_):
    forget()
    # a picture that was saved is that of the view that was active then
    _Memory.shown = {scene.session_uid: display.stand_in_key(scene) for scene in bpy.data.scenes}
    for scene in bpy.data.scenes:
        refresh(scene)


HANDLERS = (
    ("undo_post", _after_undo),
    ("redo_post", _after_undo),
    ("frame_change_post", _after_change),
    ("depsgraph_update_post", _after_change),
    # after a render without a job: in background mode, or by a script. A job's end updates the dependency graph
    ("render_complete", _after_change),
    ("render_cancel", _after_change),
    ("load_post", _after_load),
)


def register():
    """Called when the extension is enabled."""
    handlers.add(HANDLERS)


def unregister():
    """Called when the extension is disabled."""
    handlers.remove(HANDLERS)
    if bpy.app.timers.is_registered(_catch_up):
        bpy.app.timers.unregister(_catch_up)
    forget()
