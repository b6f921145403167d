"""Swatches to picture: composites the cached planes of the shown view and keeps the result image in step.

The image follows swatch edits (property updates), undo and redo, keyframes (frame changes), drivers (dependency graph
updates) and loaded files; while Blender renders it waits, and follows when that ends. Planes come from the project
folder; only those of the view shown last are kept in memory.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from bpy.app.handlers import persistent

from . import captures, folders, handlers, photos, pictures, rendering
from .engine_api import (
    BadRequest,
    DataError,
    KarfError,
    Project,
    delta_composite,
    paper_composite,
    read_planes,
    stack_palettes,
)

RESULT_NAME = "KaRF"
PHOTO_SIDE = 800  # pixels at most of a photo that stands in for a view that is not prepared
RETRY_SECONDS = 0.2


@dataclass(frozen=True)
class ShownView:
    """Planes of one view, ready for compositing.

    palette_weights: [K, M, H, W] float32. probabilities: [K, H, W]. base: [H, W, 3] float32. buffer: [H, W, 4] float32
    in Blender's row order, written anew for every picture.
    """

    file: Path
    written: int
    objects: tuple[str, ...]
    palette_weights: np.ndarray
    probabilities: np.ndarray
    base: np.ndarray
    buffer: np.ndarray


class _Memory:
    """The planes shown last; of each scene (by `session_uid`) the values last seen in a picture and the view that the
    result image shows; and how many `held` blocks are open."""

    view: ShownView | None = None
    seen: dict[int, bytes] = {}
    shown: dict[int, str] = {}
    holds: int = 0


def learned_colors(item: bpy.types.PropertyGroup) -> np.ndarray:
    """An object's palette as learned, [M, 3] float32."""
    return _colors(item, "learned")


def edited_colors(item: bpy.types.PropertyGroup) -> np.ndarray:
    """An object's palette as edited, [M, 3] float32; black stays black."""
    colors = _colors(item, "color")
    colors[:1] = learned_colors(item)[:1]
    return colors


def _colors(item: bpy.types.PropertyGroup, name: str) -> np.ndarray:
    flat = np.empty(len(item.swatches) * 3, np.float32)
    item.swatches.foreach_get(name, flat)
    return flat.reshape(-1, 3)


# --- planes --------------------------------------------------------------------------------------------------------
def planes_file(scene: bpy.types.Scene) -> Path:
    """The planes of the scene's active view. Raises BadRequest where no view of the capture is chosen."""
    if scene.karf.active_view not in scene.karf.views:
        raise BadRequest(f"The scene {scene.name!r} has no active view.", "Choose one in the KaRF panel.")
    return folders.project_of(scene).planes_file(scene.karf.active_view)


def is_prepared(scene: bpy.types.Scene) -> bool:
    """True if the active view can be shown recolored: it has planes, made of what was learned last."""
    is_chosen = scene.karf.project and scene.karf.active_view in scene.karf.views
    return bool(is_chosen) and is_current(folders.project_of(scene), scene.karf.active_view)


def is_current(project: Project, view: str) -> bool:
    """True if the view's planes exist and are no older than what they were made from."""
    sources = (project.palette_file, project.recoloring_file)
    try:
        made = project.planes_file(view).stat().st_mtime_ns
        return all(source.stat().st_mtime_ns <= made for source in sources if source.exists())
    except OSError:
        return False


def shown_view(scene: bpy.types.Scene) -> ShownView:
    """The planes of the active view, read from disk where they are not the ones in memory. Raises KarfError."""
    file = planes_file(scene)
    if not is_prepared(scene):
        what = "is older than the palettes" if file.exists() else "does not exist"
        raise DataError(f"{file} (edit planes) {what}.", "Press Prepare in step 6.")
    written = file.stat().st_mtime_ns
    known = _Memory.view
    if known is None or (known.file, known.written) != (file, written):
        planes = read_planes(file)
        height, width = planes.base.shape[:2]
        _Memory.view = ShownView(
            file=file,
            written=written,
            objects=planes.objects,
            palette_weights=planes.palette_weights.astype(np.float32),
            probabilities=planes.probabilities.astype(np.float32),
            base=planes.base.astype(np.float32) / np.float32(255),
            buffer=pictures.blank(width, height),
        )
    return _Memory.view


def forget() -> None:
    """Drop the planes in memory."""
    _Memory.view = None
    _Memory.seen.clear()


# --- the picture ---------------------------------------------------------------------------------------------------
def composite(scene: bpy.types.Scene) -> np.ndarray:
    """The active view recolored by the swatches, [H, W, 3] float32, first row at the top; overwritten by the next call.

    Raises KarfError where the view has no planes or they belong to other palettes.
    """
    view = shown_view(scene)
    colors = pictures.upright(view.buffer)
    items = {item.name: item for item in scene.karf.objects}
    if set(view.objects) != set(items):
        raise DataError(
            f"{view.file} was made for the objects {', '.join(view.objects)}.", "Extract the palettes again."
        )
    learned = stack_palettes(view.objects, {name: learned_colors(item) for name, item in items.items()})
    edited = stack_palettes(view.objects, {name: edited_colors(item) for name, item in items.items()})
    if learned.shape[1] != view.palette_weights.shape[1]:
        raise DataError(f"{view.file} was made for other palettes.", "Press Prepare in step 6.")
    if scene.karf.compositing == "paper":
        colors[:] = paper_composite(view.base, view.palette_weights, view.probabilities, edited)
    else:
        delta_composite(view.base, view.palette_weights, learned, edited, out=colors)
    return colors


def show(scene: bpy.types.Scene) -> bpy.types.Image:
    """Composite the active view into the scene's result image, which is made if needed. Raises KarfError, also while
    Blender renders."""
    rendering.refuse()
    _Memory.seen[scene.session_uid] = _values(scene)
    composite(scene)
    return _put(scene, _Memory.view.buffer)


def _put(scene: bpy.types.Scene, buffer: np.ndarray) -> bpy.types.Image:
    """Make an RGBA buffer [H, W, 4] the scene's result image, as the active view's picture."""
    height, width = buffer.shape[:2]
    if scene.karf.result is None:
        scene.karf.result = pictures.new_image(RESULT_NAME, width, height)
    pictures.fit(scene.karf.result, width, height)
    pictures.upload(scene.karf.result, buffer)
    _Memory.shown[scene.session_uid] = scene.karf.active_view
    return scene.karf.result


def follow(scene: bpy.types.Scene) -> None:
    """Bring the result image up to date after a change, where there is one to show; never raises.

    A view that cannot be shown recolored shows its photo instead: never another view's picture.
    """
    if rendering.is_running():
        _follow_later()
        return
    if _Memory.holds or scene.karf.result is None:
        return
    try:
        show(scene)
    except KarfError:  # the panel says that the view is not prepared
        if _Memory.shown.get(scene.session_uid) != scene.karf.active_view:
            _put(scene, _photo(scene))


def _photo(scene: bpy.types.Scene) -> np.ndarray:
    """The active view's photo as an RGBA buffer [H, W, 4], reduced to PHOTO_SIDE; black where it cannot be read."""
    try:
        view = captures.view_of(scene)
        colors = photos.read(view, PHOTO_SIDE) if view.image else None
    except KarfError:
        colors = None
    if colors is None:
        return pictures.blank(*scene.karf.result.size)
    buffer = pictures.blank(colors.shape[1], colors.shape[0])
    pictures.upright(buffer)[:] = colors
    return buffer


def _follow_changed() -> None:
    """Bring the pictures of all scenes up to date whose values are not those last seen in them."""
    for scene in bpy.data.scenes:
        if scene.karf.result is not None and _values(scene) != _Memory.seen.get(scene.session_uid):
            follow(scene)


def _follow_later() -> None:
    # in background mode timers never fire; there a render's last handler follows
    if not bpy.app.background and not bpy.app.timers.is_registered(_catch_up):
        bpy.app.timers.register(_catch_up, first_interval=RETRY_SECONDS)


def _catch_up() -> float | None:
    """The timer: waits until Blender has rendered."""
    if not rendering.is_over():
        return RETRY_SECONDS
    _follow_changed()
    return None


@contextmanager
def held(scene: bpy.types.Scene) -> Iterator[None]:
    """Change many swatches inside this block and get one new picture at its end."""
    _Memory.holds += 1
    try:
        yield
    finally:
        _Memory.holds -= 1
    follow(scene)


def _values(scene: bpy.types.Scene) -> bytes:
    """All that keyframes can change in a picture, as one comparable value."""
    colors = [edited_colors(item).tobytes() for item in scene.karf.objects]
    return b"".join([scene.karf.compositing.encode(), scene.karf.active_view.encode(), *colors])


# --- handlers ------------------------------------------------------------------------------------------------------
@persistent
def _after_undo(*_):
    # undo takes swatches back, but neither pixels nor update callbacks
    follow(bpy.context.scene)


@persistent
def _after_change(*_):
    # animated and driven swatches change without their update callback; a render job calls this on its own thread
    if not rendering.is_running():
        _follow_changed()


@persistent
def _after_load(*_):
    forget()
    # a picture that was saved is that of the view that was active then
    _Memory.shown = {scene.session_uid: scene.karf.active_view for scene in bpy.data.scenes}
    for scene in bpy.data.scenes:
        follow(scene)


@persistent
def _before_save(target, *_):
    # pixels that are only in memory are not saved
    for scene in bpy.data.scenes:
        for image in (scene.karf.result, scene.karf.mask_image):
            if image is not None and image.is_dirty:
                image.pack()
    if isinstance(target, str) and target:
        folders.rebase(bpy.data.filepath, target)


@persistent
def _after_save(target, *_):
    # a saved copy and a file that could not be written leave the open file where it was
    if isinstance(target, str) and target:
        folders.rebase(target, bpy.data.filepath)


HANDLERS = (
    ("undo_post", _after_undo),
    ("redo_post", _after_undo),
    ("frame_change_post", _after_change),
    ("depsgraph_update_post", _after_change),
    # after a render without a job: in background mode, or by a script. A job's end updates the dependency graph
    ("render_complete", _after_change),
    ("render_cancel", _after_change),
    ("load_post", _after_load),
    ("save_pre", _before_save),
    ("save_post", _after_save),
    ("save_post_fail", _after_save),
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
