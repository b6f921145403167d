"""Displayed pictures: each scene's result image, kept up to date with its swatches, and a followed camera's.

It follows swatch edits, undo, keyframes, drivers and loaded files; while Blender renders it waits.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import bpy
import numpy as np

from .. import session
from ..engine_api import UNIT_GAINS, ColorHistogram, DataError, KarfError, read_object_colors, read_planes
from ..host import rendering, windows
from ..pictures import editors, images
from ..project import disk, folders
from . import colors, object_masks, solving, views
from .object_masks import ObjectMasks
from .views import DisplayedView, PictureFiles

RESULT_NAME = "KaRF"
CAMERA_NAME = f"{editors.PREFIX} camera"
RETRY_SECONDS = 0.2


@dataclass
class DisplayedScene:
    """The displayed picture of one scene and its sources; drawing uses only what is in memory."""

    scene: bpy.types.Scene  # as `of` was last asked for it: undo replaces it
    view: DisplayedView | None = None  # the planes displayed last
    camera: DisplayedView | None = None  # the planes of the followed camera, if it is this scene's
    files: PictureFiles = field(default_factory=PictureFiles)
    masks: tuple[tuple, ObjectMasks | None] = ((), None)  # as read last, and what from
    histograms: dict[tuple[Path, int, str], ColorHistogram] = field(default_factory=dict)  # by file, time and object
    spread: dict[str, tuple[bytes, ColorHistogram, ColorHistogram]] = field(default_factory=dict)  # see `histogram`
    moved: dict[str, tuple[tuple, float]] = field(default_factory=dict)  # see `solving.moved_elsewhere`, by object
    left: dict[str, tuple[tuple, float]] = field(default_factory=dict)  # to the target, with what it was found of
    surfaces: dict[str, bytes] = field(default_factory=dict)  # what the surfaces of each object were solved of
    values: bytes = b""  # what the picture was made from
    placeholder_key: tuple = ()  # what a placeholder for the picture would have been made from

    # --- the picture -----------------------------------------------------------------------------------------------
    def refresh(self) -> None:
        """Bring the result image up to date after a change, if there is one; never raises."""
        if rendering.is_running():
            if not bpy.app.background:  # there timers never fire, and a render's last handler refreshes
                session.start_timer(_catch_up, RETRY_SECONDS)
            return
        self.update_surfaces()
        if is_batched() or self.scene.karf.result is None:
            return
        try:
            self.recolor()
        except KarfError:  # the panel says that the view is not prepared; its photo is displayed, never another view
            if self.placeholder_key != views.placeholder_key(self.scene):
                self.show_unedited()
            self.update_left()

    def recolor(self) -> bpy.types.Image:
        """Put the active view into the result image. Raises KarfError if it cannot be composited, or Blender renders."""
        rendering.refuse()
        self.values = colors.fingerprint(self.scene)
        return self._put(views.picture(self.scene, self.prepared_view(), self.files))

    def update_surfaces(self) -> None:
        """Bring the shifts of the scene's swatches up to date, of objects whose colors were counted."""
        if is_batched():
            return
        for item in self.scene.karf.objects:
            state = colors.state(item)
            if self.surfaces.get(item.name) != state.key:
                with suppress(KarfError, OSError):
                    colors.write(item, self._shifts(state), "shift")
                    self.surfaces[item.name] = colors.state(item).key

    def solved(self, item: bpy.types.PropertyGroup) -> np.ndarray:
        """Return `colors.edited` with surfaces solved anew: while Blender renders, the scene cannot keep them."""
        state = colors.state(item)
        try:
            return replace(state, shift=self._shifts(state)).edited
        except (KarfError, OSError):
            return state.edited

    def _shifts(self, state: solving.PaletteState) -> np.ndarray:
        return solving.surface_shifts(state, None if state.is_neutral else self.histogram(state))

    def show_unedited(self) -> bpy.types.Image:
        """Put the placeholder of a view into the result image. Raises BadRequest while Blender renders."""
        rendering.refuse()
        return self._put(views.placeholder(self.scene, self.files))

    def _put(self, buffer: np.ndarray) -> bpy.types.Image:
        """Make an RGBA buffer [H, W, 4] the result image."""
        karf, old = self.scene.karf, self.scene.karf.result
        is_shared = any(other.karf.result == old for other in bpy.data.scenes if other != self.scene)  # a copied scene
        karf.result = _filled(None if is_shared else old, RESULT_NAME, buffer)
        for area in windows.areas("IMAGE_EDITOR") if is_shared else ():
            if windows.window_of(area).scene == self.scene and area.spaces.active.image == old:
                editors.show(area, karf.result)
        self.placeholder_key = views.placeholder_key(self.scene)
        self.load_masks()
        self.update_left()
        return self.scene.karf.result

    def edited(self) -> np.ndarray:
        """Return the active view recolored by the swatches; see `DisplayedView.recolored` and `prepared_view`."""
        return self.prepared_view().recolored(self.scene)

    # --- what is read from the project -----------------------------------------------------------------------------
    def prepared_view(self) -> DisplayedView:
        """Return the active view, read anew if changed. Raises KarfError if its planes are missing, old or damaged."""
        file = disk.planes_file(self.scene)
        if not disk.is_prepared(self.scene):
            raise DataError(
                "{file} (edit planes) was made from other palettes."
                if file.exists()
                else "{file} (edit planes) does not exist.",
                "Press Prepare in step 4.",
                file=file,
            )
        written = file.stat().st_mtime_ns if file.exists() else 0
        if self.view is None or (self.view.file, self.view.written) != (file, written):
            self.view = DisplayedView(file, written, read_planes(file))
        return self.view

    @property
    def gains(self) -> tuple[float, float, float]:
        """The exposure of the active view's photo, as far as its planes tell; never raises."""
        try:
            return self.prepared_view().planes.gains
        except (KarfError, OSError):
            return UNIT_GAINS

    def load_masks(self) -> None:
        """Read the masks of the active view if they are displayed and changed; never raises."""
        if not bpy.context.window_manager.karf_seeing.show_masks or not self.scene.karf.project:
            return
        try:
            is_prepared = disk.is_prepared(self.scene)
            files = {"": disk.planes_file(self.scene)} if is_prepared else disk.rendered_masks(self.scene)
            key = (*self._place(), *((file, file.stat().st_mtime_ns) for file in files.values()))
            if key != self.masks[0]:
                if is_prepared:
                    masks = object_masks.of_planes(self.prepared_view().planes, self.scene)
                else:
                    masks = object_masks.of_files(files, self.scene)
                self.masks = key, masks
        except (KarfError, OSError):
            self.masks = (), None

    def known_masks(self) -> ObjectMasks | None:
        """Return the masks of the active view, as prepared for recoloring, else as segmented; None if not read."""
        key, masks = self.masks
        return masks if key[:2] == self._place() else None

    def _place(self) -> tuple[str, str]:
        return self.scene.karf.project, self.scene.karf.active_view

    def learned_histogram(self, name: str) -> ColorHistogram:
        """Return an object's colors in the photos, read once. Raises KarfError if the project lacks them."""
        project = folders.project_of(self.scene)
        file = project.object_colors_file
        key = file, file.stat().st_mtime_ns if file.exists() else 0, name
        if key not in self.histograms:
            self.histograms[key] = read_object_colors(project.verified(file), name)
        return self.histograms[key]

    def histogram(self, state: solving.PaletteState) -> ColorHistogram:
        """Return the same with weights that are spread over the sets of the object's added colors."""
        learned = self.learned_histogram(state.name)
        if not state.is_added.any():
            return learned
        key = b"".join(
            each.tobytes() for each in (state.learned, state.is_added, state.reach, state.protect, state.idle)
        )
        known = self.spread.get(state.name)
        if known is None or known[0] != key or known[1] is not learned:
            known = self.spread[state.name] = key, learned, state.spread(learned)
        return known[2]

    # --- target colors ---------------------------------------------------------------------------------------------
    def left_to_target(self, item: bpy.types.PropertyGroup) -> float | None:
        """Return what `update_left` found; None if the object has no target color."""
        known = self.left.get(item.name)
        return known[1] if known and known[0][:2] == colors.color_pair(item) else None

    def _update_moved(self, item: bpy.types.PropertyGroup) -> None:
        state = colors.state(item)
        key = state.key, self.scene.karf.project
        if state.is_paint.any() and self.moved.get(item.name, ((), 0.0))[0] != key:
            with suppress(KarfError, OSError):
                self.moved[item.name] = key, solving.moved_elsewhere(state, self.learned_histogram(item.name))

    def update_left(self) -> None:
        """Bring what the panel says of swatches and target colors up to date with them; never raises."""
        for item in self.scene.karf.objects:
            self._update_moved(item)
            source, target = colors.color_pair(item)
            if source == target:
                self.left.pop(item.name, None)
                continue
            state, before = colors.state(item), colors.stored(item, "before").tobytes()
            own = item.scope, item.held, item.is_metal, *item.gains
            key = source, target, self.scene.karf.project, *own, state.key, before
            if item.name not in self.left or self.left[item.name][0] != key:
                try:
                    left = solving.left_to_target(state, colors.becoming(item), self.histogram(state))
                    self.left[item.name] = key, left
                except (KarfError, OSError):  # the project is gone, or has no such object yet
                    self.left.pop(item.name, None)


# --- all scenes ----------------------------------------------------------------------------------------------------
@dataclass
class _State:
    per_file = True
    scenes: dict[int, DisplayedScene] = field(default_factory=dict)  # by `session_uid`
    open_batches: int = 0  # `batched` blocks


def _scenes() -> dict[int, DisplayedScene]:
    return session.get(_State).scenes


def of(scene: bpy.types.Scene) -> DisplayedScene:
    """Return what is displayed of a scene."""
    known = _scenes().get(scene.session_uid)
    if known is None:
        known = _scenes()[scene.session_uid] = DisplayedScene(scene)
    known.scene = scene
    return known


def forget(scene: bpy.types.Scene) -> None:
    """Read all of a scene again when it is needed; what its pictures display is still known."""
    known = of(scene)
    _scenes()[scene.session_uid] = DisplayedScene(scene, camera=known.camera, placeholder_key=known.placeholder_key)


@contextmanager
def batched(scene: bpy.types.Scene) -> Iterator[None]:
    """Change many swatches inside this block and get one new picture at its end."""
    state = session.get(_State)
    state.open_batches += 1
    try:
        yield
    finally:
        state.open_batches -= 1
    of(scene).refresh()


def is_batched() -> bool:
    """Tell whether a program sets swatches in a `batched` block: no artist drags one."""
    return session.get(_State).open_batches > 0


def _filled(image: bpy.types.Image | None, name: str, buffer: np.ndarray) -> bpy.types.Image:
    """Put an RGBA buffer [H, W, 4] into an image, or into a new one."""
    height, width = buffer.shape[:2]
    image = image or images.new_image(name, width, height)
    images.fit(image, width, height)
    images.upload(image, buffer)
    images.note_change(image)
    return image


def _refresh_changed() -> None:
    """Bring the pictures of all scenes with other values up to date; drop removed scenes."""
    for uid in _scenes().keys() - {scene.session_uid for scene in bpy.data.scenes}:
        del _scenes()[uid]
    for scene in bpy.data.scenes:
        of(scene).update_surfaces()
        if scene.karf.result is not None and colors.fingerprint(scene) != of(scene).values:
            of(scene).refresh()


def _catch_up() -> float | None:
    """Refresh, as a timer, when Blender has rendered."""
    if not rendering.is_over():
        return RETRY_SECONDS
    _refresh_changed()
    return None


# --- the followed camera -------------------------------------------------------------------------------------------
def camera_image() -> bpy.types.Image | None:
    """Return the image of the followed camera, if there is one."""
    return bpy.data.images.get(CAMERA_NAME)


def show_camera(scene: bpy.types.Scene, view: DisplayedView, width: int, height: int) -> None:
    """Put a camera's picture into its image, at this size, and follow it. Raises KarfError if it cannot be composited."""
    known = of(scene)
    picture = views.picture(scene, view, known.files)
    before = camera_image()
    image = _filled(before, CAMERA_NAME, images.enlarged(picture, width, height))
    if before is None:
        editors.reveal(image, is_wanted=True, is_whole=True)
    known.camera = view
    if bpy.context.window_manager.karf_seeing.show_masks and view.planes.objects and view.masks is None:
        view.masks = object_masks.of_planes(view.planes, scene)


def followed_camera() -> DisplayedView | None:
    """Return the planes of the followed camera, of whichever scene."""
    return next((known.camera for known in _scenes().values() if known.camera is not None), None)


def follow_no_camera() -> None:
    """End following; the last picture stays."""
    for known in _scenes().values():
        known.camera = None


def is_camera_in(space: bpy.types.Space) -> bool:
    """Tell whether an Image Editor shows the picture of a followed camera."""
    return followed_camera() is not None and space.image is not None and space.image == camera_image()


# --- handlers ------------------------------------------------------------------------------------------------------
@session.handler("undo_post", "redo_post")
def _after_undo(*_):
    # undo takes swatches back, but neither pixels nor update callbacks
    of(bpy.context.scene).refresh()


@session.handler("frame_change_post", "depsgraph_update_post", "render_complete", "render_cancel")
def _after_change(*_):
    # animated and driven swatches change without their update callback; a render job calls this on its own thread
    if not rendering.is_running():
        _refresh_changed()


@session.handler("load_post")
def _after_load(*_):
    for scene in bpy.data.scenes:
        # a saved picture is that of the view active then
        of(scene).placeholder_key = views.placeholder_key(scene)
        of(scene).refresh()
