"""Swatches to picture: composites the cached planes of the shown view and keeps the result image in step.

The image follows swatch edits (property updates), undo and redo, keyframes (frame changes) and loaded files. Planes
come from the project folder; only those of the view shown last are kept in memory.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from bpy.app.handlers import persistent

from . import folders, pictures
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
    """The view shown last, the swatch values last seen in a picture, and how many `held` blocks are open."""

    view: ShownView | None = None
    seen: bytes = b""
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
    """The planes of the scene's active view. Raises BadRequest where no view is chosen."""
    if not scene.karf.active_view:
        raise BadRequest(f"The scene {scene.name!r} has no active view.", "Choose one in the KaRF panel.")
    return folders.project_of(scene).planes_file(scene.karf.active_view)


def is_prepared(scene: bpy.types.Scene) -> bool:
    """True if the active view has planes, current or not."""
    return bool(scene.karf.project and scene.karf.active_view) and planes_file(scene).exists()


def is_current(project: Project, view: str) -> bool:
    """True if the view's planes exist and are no older than what they were made from."""
    planes, sources = project.planes_file(view), (project.palette_file, project.recoloring_file)
    if not planes.exists():
        return False
    made = planes.stat().st_mtime_ns
    return all(source.stat().st_mtime_ns <= made for source in sources if source.exists())


def shown_view(scene: bpy.types.Scene) -> ShownView:
    """The planes of the active view, read from disk where they are not the ones in memory. Raises KarfError."""
    file = planes_file(scene)
    if not file.exists():
        raise DataError(f"{file} (edit planes) does not exist.", "Press Prepare in step 6.")
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
    _Memory.seen = b""


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
    if learned.shape[1] > view.palette_weights.shape[1]:
        raise DataError(f"{view.file} was made for smaller palettes.", "Press Prepare in step 6.")
    if scene.karf.compositing == "paper":
        colors[:] = paper_composite(view.base, view.palette_weights, view.probabilities, edited)
    else:
        delta_composite(view.base, view.palette_weights, learned, edited, out=colors)
    return colors


def show(scene: bpy.types.Scene) -> bpy.types.Image:
    """Composite the active view into the scene's result image, which is made if needed. Raises KarfError."""
    composite(scene)
    buffer = _Memory.view.buffer
    height, width = buffer.shape[:2]
    if scene.karf.result is None:
        scene.karf.result = pictures.new_image(RESULT_NAME, width, height)
    pictures.fit(scene.karf.result, width, height)
    pictures.upload(scene.karf.result, buffer)
    _Memory.seen = _values(scene)
    return scene.karf.result


def follow(scene: bpy.types.Scene) -> None:
    """Bring the result image up to date after a change, where there is one to show; never raises."""
    if _Memory.holds or scene.karf.result is None:
        return
    try:
        show(scene)
    except KarfError:
        # a view whose planes are not rendered yet: the panel says so, the last picture stays
        _Memory.seen = _values(scene)


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
def _after_frame_change(scene, *_):
    # an animated swatch changes without its update callback
    if scene.karf.result is not None and _values(scene) != _Memory.seen:
        follow(scene)


@persistent
def _after_load(*_):
    forget()
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
    # a saved copy leaves the open file where it was
    if isinstance(target, str) and target:
        folders.rebase(target, bpy.data.filepath)


HANDLERS = (
    ("undo_post", _after_undo),
    ("redo_post", _after_undo),
    ("frame_change_post", _after_frame_change),
    ("load_post", _after_load),
    ("save_pre", _before_save),
    ("save_post", _after_save),
)


def register():
    """Called when the extension is enabled."""
    for name, handler in HANDLERS:
        getattr(bpy.app.handlers, name).append(handler)


def unregister():
    """Called when the extension is disabled."""
    for name, handler in reversed(HANDLERS):
        getattr(bpy.app.handlers, name).remove(handler)
    forget()
