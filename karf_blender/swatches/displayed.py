"""What is shown of each scene, and its result image, which is kept up to date with its swatches.

A scene has one `DisplayedScene`, which keeps what was read from disk and what was composed of it. Its picture follows swatch
edits (property updates), undo and redo, keyframes (frame changes), drivers (dependency graph updates) and loaded files;
while Blender renders it waits, and follows when that ends.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import bpy
import numpy as np

from .. import session
from ..engine_api import UNIT_GAINS, ColorHistogram, DataError, KarfError, read_object_colors, read_planes
from ..host import rendering
from ..pictures import images
from ..project import disk, folders
from . import colors, object_masks, solving, views
from .object_masks import ObjectMasks
from .views import DisplayedView, PictureFiles

RESULT_NAME = "KaRF"
RETRY_SECONDS = 0.2


@dataclass
class DisplayedScene:
    """What is shown of one scene. Drawing only asks for what is in memory."""

    scene: bpy.types.Scene  # as `of` was last asked for it: undo replaces it
    view: DisplayedView | None = None  # the planes shown last
    camera: DisplayedView | None = None  # the planes of the camera that is followed, where it is this scene's
    files: PictureFiles = field(default_factory=PictureFiles)
    masks: tuple[tuple, ObjectMasks | None] = ((), None)  # as read last, and what from
    histograms: dict[tuple[Path, int, str], ColorHistogram] = field(default_factory=dict)  # by file, time and object
    spread: dict[str, tuple[bytes, ColorHistogram, ColorHistogram]] = field(default_factory=dict)  # see `histogram_of`
    left: dict[str, tuple[tuple, float]] = field(default_factory=dict)  # to the target, with what it was found of
    surfaces: dict[str, bytes] = field(default_factory=dict)  # what the surfaces of each object were solved of
    values: bytes = b""  # what the picture was made from
    placeholder_key: tuple = ()  # what a placeholder for the picture would have been made from

    # --- the picture -----------------------------------------------------------------------------------------------
    def refresh(self) -> None:
        """Bring the result image up to date after a change, where there is one to show; never raises.

        A view that cannot be shown recolored shows its photo instead: never another view's picture.
        """
        if rendering.is_running():
            _refresh_later()
            return
        self.update_surfaces()
        if session.get(_State).open_batches or self.scene.karf.result is None:
            return
        try:
            self.recolor()
        except KarfError:  # the panel says that the view is not prepared
            if self.placeholder_key != views.placeholder_key(self.scene):
                self.show_unedited()
            self.update_left()

    def recolor(self) -> bpy.types.Image:
        """Put the active view, as it is looked at, into the scene's result image, which is made if needed.

        Raises:
            KarfError: The view cannot be composited, or Blender renders.
        """
        rendering.refuse()
        self.values = colors.fingerprint(self.scene)
        return self._put(views.picture(self.scene, self.prepared_view(), self.files))

    def update_surfaces(self) -> None:
        """Bring the shifts of the scene's swatches up to date; those of an object whose colors nobody counted stay."""
        if session.get(_State).open_batches:
            return
        for item in self.scene.karf.objects:
            state = colors.state(item)
            if self.surfaces.get(item.name) != state.key:
                with suppress(KarfError, OSError):
                    colors.write(item, self._shifts(state), "shift")
                    self.surfaces[item.name] = colors.state(item).key

    def solved(self, item: bpy.types.PropertyGroup) -> np.ndarray:
        """As `colors.edited`, with what surfaces add found anew and not kept.

        While Blender renders nothing can be put into the scene, and keyframed numbers move on.
        """
        state = colors.state(item)
        try:
            return replace(state, shift=self._shifts(state)).edited
        except (KarfError, OSError):
            return state.edited

    def _shifts(self, state: solving.PaletteState) -> np.ndarray:
        seen = None if state.is_neutral else self.histogram_of(state)
        return solving.surface_shifts(state, seen)

    def show_unedited(self) -> bpy.types.Image:
        """Put what there is of a view that cannot be recolored into the result image, which is made if needed.

        Raises:
            BadRequest: Blender renders.
        """
        rendering.refuse()
        return self._put(views.placeholder(self.scene, self.files))

    def _put(self, buffer: np.ndarray) -> bpy.types.Image:
        """Make an RGBA buffer [H, W, 4] the result image, as the active view's picture."""
        karf, (height, width) = self.scene.karf, buffer.shape[:2]
        if karf.result is None:
            karf.result = images.new_image(RESULT_NAME, width, height)
        images.fit(karf.result, width, height)
        images.upload(karf.result, buffer)
        images.note_change(karf.result)
        self.placeholder_key = views.placeholder_key(self.scene)
        self.load_masks()
        self.update_left()
        return karf.result

    def edited(self) -> np.ndarray:
        """The active view recolored by the swatches, however it is looked at; see `DisplayedView.recolored`.

        Raises:
            KarfError: The view has no planes, or they belong to other palettes.
        """
        return self.prepared_view().recolored(self.scene)

    # --- what is read from the project -----------------------------------------------------------------------------
    def prepared_view(self) -> DisplayedView:
        """The active view with its planes, read from disk where they are not the ones in memory.

        Raises:
            KarfError: There are none, or they were made from other palettes, or are damaged.
        """
        file = disk.planes_file(self.scene)
        if not disk.is_prepared(self.scene):
            raise DataError(
                "{file} (edit planes) was made from other palettes."
                if file.exists()
                else "{file} (edit planes) does not exist.",
                "Press Prepare in step 6.",
                file=file,
            )
        written = file.stat().st_mtime_ns if file.exists() else 0
        if self.view is None or (self.view.file, self.view.written) != (file, written):
            self.view = DisplayedView(file, written, read_planes(file))
        return self.view

    @property
    def gains(self) -> tuple[float, float, float]:
        """How the photo of the active view is exposed, as far as its planes tell; never raises."""
        try:
            return self.prepared_view().planes.gains
        except (KarfError, OSError):
            return UNIT_GAINS

    def load_masks(self) -> None:
        """Read the masks of the active view, where they are looked at and not the ones in memory; never raises."""
        if not bpy.context.window_manager.karf_seeing.show_masks or not self.scene.karf.project:
            return
        try:
            is_prepared = disk.is_prepared(self.scene)
            files = {"": disk.planes_file(self.scene)} if is_prepared else disk.rendered_masks(self.scene)
            key = (*self._place(), *((file, file.stat().st_mtime_ns) for file in files.values()))
            if key != self.masks[0]:
                self.masks = key, self._read_masks(None if is_prepared else files)
        except (KarfError, OSError):
            self.masks = (), None

    def _read_masks(self, files: Mapping[str, Path] | None) -> ObjectMasks | None:
        """The active view's from these files, by object; None: from its planes."""
        if files is None:
            return object_masks.of_planes(self.prepared_view().planes, self.scene)
        return object_masks.of_files(files, self.scene)

    def known_masks(self) -> ObjectMasks | None:
        """The masks of the active view, as prepared for recoloring, else as segmented; None where none were read."""
        key, masks = self.masks
        return masks if key[:2] == self._place() else None

    def _place(self) -> tuple[str, str]:
        return self.scene.karf.project, self.scene.karf.active_view

    def learned_histogram(self, name: str) -> ColorHistogram:
        """An object's colors in the photos, read once.

        Raises:
            KarfError: There is no project, or it is damaged or has no such object.
        """
        project = folders.project_of(self.scene)
        file = project.object_colors_file
        key = file, file.stat().st_mtime_ns if file.exists() else 0, name
        if key not in self.histograms:
            self.histograms[key] = read_object_colors(project.verified(file), name)
        return self.histograms[key]

    def histogram(self, item: bpy.types.PropertyGroup) -> ColorHistogram:
        """The same with weights that are spread over the sets of the object's added colors."""
        return self.histogram_of(colors.state(item))

    def histogram_of(self, state: solving.PaletteState) -> ColorHistogram:
        """The same of an object's swatches."""
        learned = self.learned_histogram(state.name)
        if not state.is_added.any():
            return learned
        key = b"".join(each.tobytes() for each in (state.learned, state.is_added, state.reach, state.protect))
        known = self.spread.get(state.name)
        if known is None or known[0] != key or known[1] is not learned:
            known = self.spread[state.name] = key, learned, state.spread(learned)
        return known[2]

    # --- target colors ---------------------------------------------------------------------------------------------
    def left_to_target(self, item: bpy.types.PropertyGroup) -> float | None:
        """See `solving.left_to_target`; None where the object has no target color."""
        known = self.left.get(item.name)
        return known[1] if known and known[0][:2] == colors.color_pair(item) else None

    def update_left(self) -> None:
        """Find anew what is left where swatches or target colors have changed; never raises."""
        for item in self.scene.karf.objects:
            source, target = colors.color_pair(item)
            if source == target:
                self.left.pop(item.name, None)
                continue
            state, before = colors.state(item), colors.stored(item, "before").tobytes()
            own = item.rule, item.held, item.is_metal, *item.gains
            key = source, target, self.scene.karf.project, *own, state.key, before
            if item.name not in self.left or self.left[item.name][0] != key:
                try:
                    seen = self.histogram_of(state)
                    self.left[item.name] = key, solving.left_to_target(state, colors.becoming(item), seen)
                except (KarfError, OSError):  # the project is gone, or has no such object yet
                    self.left.pop(item.name, None)


# --- all scenes ----------------------------------------------------------------------------------------------------
@dataclass
class _State:
    """What is shown of each scene (by `session_uid`), and how many `batched` blocks are open."""

    scenes: dict[int, DisplayedScene] = field(default_factory=dict)
    open_batches: int = 0


def of(scene: bpy.types.Scene) -> DisplayedScene:
    """What is shown of a scene."""
    known = session.get(_State).scenes.get(scene.session_uid)
    if known is None:
        known = session.get(_State).scenes[scene.session_uid] = DisplayedScene(scene)
    known.scene = scene
    return known


def followed_camera() -> DisplayedView | None:
    """The planes of the camera that is followed, of whichever scene."""
    return next((known.camera for known in session.get(_State).scenes.values() if known.camera is not None), None)


def follow_no_camera() -> None:
    """No camera is followed any more; its last picture stays as it is."""
    for known in session.get(_State).scenes.values():
        known.camera = None


def forget(scene: bpy.types.Scene) -> None:
    """Read all of a scene anew at the next question. What its pictures show stays known."""
    known = of(scene)
    session.get(_State).scenes[scene.session_uid] = DisplayedScene(
        scene, camera=known.camera, placeholder_key=known.placeholder_key
    )


def forget_all() -> None:
    """Drop what is in memory of all scenes."""
    session.get(_State).scenes.clear()


@contextmanager
def batched(scene: bpy.types.Scene) -> Iterator[None]:
    """Change many swatches inside this block and get one new picture at its end."""
    session.get(_State).open_batches += 1
    try:
        yield
    finally:
        session.get(_State).open_batches -= 1
    of(scene).refresh()


def is_batched() -> bool:
    """Whether a `batched` block is open: a program sets swatches, no artist drags one."""
    return session.get(_State).open_batches > 0


def _refresh_changed() -> None:
    """Bring the pictures of all scenes up to date whose values have changed since; drop scenes that are gone."""
    for uid in session.get(_State).scenes.keys() - {scene.session_uid for scene in bpy.data.scenes}:
        del session.get(_State).scenes[uid]
    for scene in bpy.data.scenes:
        of(scene).update_surfaces()
        if scene.karf.result is not None and colors.fingerprint(scene) != of(scene).values:
            of(scene).refresh()


def _refresh_later() -> None:
    # in background mode timers never fire; there a render's last handler follows
    if not bpy.app.background and not bpy.app.timers.is_registered(_catch_up):
        session.start_timer(_catch_up, RETRY_SECONDS)


def _catch_up() -> float | None:
    """The timer: waits until Blender has rendered."""
    if not rendering.is_over():
        return RETRY_SECONDS
    _refresh_changed()
    return None


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
    forget_all()
    for scene in bpy.data.scenes:
        # a picture that was saved is that of the view that was active then
        of(scene).placeholder_key = views.placeholder_key(scene)
        of(scene).refresh()
