"""Views: their edit planes, the picture that these make with the swatches, and how it is looked at.

`WindowManager.karf_seeing` (properties/seeing.py) says what is shown of a view or a free camera: the edited picture or
another side of it, with a split view or without.
"""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import ceil, sqrt
from pathlib import Path

import bpy
import numpy as np

from ..engine_api import (
    DataError,
    EdgeShape,
    KarfError,
    ObjectPlanes,
    Planes,
    SwatchPicture,
    ciede2000,
    delta_picture,
    paper_picture,
    split_weights_of_objects,
    srgb_to_lab,
    stack_palettes,
    to_photo_exposure,
)
from ..pictures import images, photos
from ..project import captures, contents, folders
from . import colors, edges
from .object_masks import ObjectMasks

PHOTO_SIDE = 800  # pixels at most of a photo that stands in for a view that is not prepared
COMPARED_PIXELS = 160_000  # of a difference picture: larger ones are compared in every second pixel, or third
HOTTEST = 20.0  # CIEDE2000 from which the heat map is white
UNSURE = np.array([1.0, 0.55, 0.04], np.float32)  # color of unsure pixels
DIMMED = np.float32(0.4)  # factor of the rest of the picture
HEAT = np.array([[0, 0, 0.05], [0.33, 0.06, 0.43], [0.73, 0.21, 0.33], [0.98, 0.55, 0.04], [1, 1, 0.75]], np.float32)


@dataclass(eq=False)
class DisplayedView:
    """Planes of one view, ready for compositing."""

    file: Path
    written: int  # the file's time, in nanoseconds
    planes: Planes
    is_free: bool = False  # a camera's that has no photo: the base is what is learned
    masks: ObjectMasks | None = None  # once they were painted
    pictures: dict[str, tuple[SwatchPicture, np.ndarray]] = field(default_factory=dict)  # with its RGBA, by compositing
    movable: dict[int, edges.MovableObject] = field(default_factory=dict)  # objects whose edges were changed already
    moved: dict[int, ObjectPlanes] = field(default_factory=dict)  # their parts of the picture that adds changes
    edges: dict[str, EdgeShape] = field(default_factory=dict)  # in that picture, by object
    with_edges: dict[str, "DisplayedView"] = field(default_factory=dict)  # the view whose objects end there, by edges
    with_sets: dict[str, "DisplayedView"] = field(default_factory=dict)  # spread over sets, by added colors
    canvas: np.ndarray | None = None  # RGBA, for a picture that is not just the edited one
    split_at: int = 0  # the canvas has the original left of this column

    def recolored(self, scene: bpy.types.Scene) -> np.ndarray:
        """Recolor the view by a scene's swatches; planes of before palettes were learned show their base.

        Returns:
            RGBA buffer [H, W, 4] float32 in Blender's row order (see `images.upright`); overwritten by the next call.

        Raises:
            DataError: The planes belong to other palettes.
        """
        if not self.planes.palette_weights.shape[1]:
            return self._picture("delta")[1]
        compositing = scene.karf.compositing
        view = self._ended(scene).spread(scene) if compositing == "paper" else self.spread(scene)
        objects, items = view.planes.objects, {item.name: item for item in scene.karf.objects}
        factors = stack_palettes(objects, {name: colors.edited(item) for name, item in items.items()})
        if compositing != "paper":
            self._move_edges(scene, view)
            factors -= stack_palettes(objects, {name: colors.learned(item) for name, item in items.items()})
        picture, buffer = view._picture(compositing)
        picture.paint(to_photo_exposure(factors, self.planes.gains))
        return buffer

    def spread(self, scene: bpy.types.Scene) -> "DisplayedView":
        """The view with its weights spread over the sets of the scene's added colors; without such colors itself.

        Raises:
            DataError: The planes belong to other palettes.
        """
        objects, learned = self.planes.objects, {palette.name: palette for palette in colors.palettes(scene)}
        if set(objects) != set(learned):
            raise DataError(
                "{file} was made for the objects {objects}.",
                "Extract the palettes again.",
                file=self.file,
                objects=", ".join(objects),
            )
        if max(len(palette.colors) for palette in learned.values()) != self.planes.palette_weights.shape[1]:
            raise DataError("{file} was made for other palettes.", "Press Prepare in step 6.", file=self.file)
        added = colors.added_by_object(scene)
        if not added:
            return self
        key = repr([(name, colors.keys(own)) for name, own in added.items()])
        if key not in self.with_sets:
            weights = split_weights_of_objects(self.planes.palette_weights, [learned[name] for name in objects], added)
            planes = dataclasses.replace(self.planes, palette_weights=weights)
            self.with_sets.clear()
            self.with_sets[key] = DisplayedView(self.file, self.written, planes)
        return self.with_sets[key]

    def _ended(self, scene: bpy.types.Scene) -> "DisplayedView":
        """The view with objects that end where the scene's edges do; without such edges itself."""
        wanted = colors.edges(scene)
        if not wanted:
            return self
        if repr(wanted) not in self.with_edges:
            self.with_edges.clear()
            planes = edges.ended(scene, self.planes, wanted)
            self.with_edges[repr(wanted)] = DisplayedView(self.file, self.written, planes)
        return self.with_edges[repr(wanted)]

    def _move_edges(self, scene: bpy.types.Scene, view: "DisplayedView") -> None:
        """Let the objects in the picture of `view`, which is this one spread, end where the scene's edges do."""
        wanted = colors.edges(scene)
        if view.edges and not wanted:  # begun anew it has the planes' own bits
            view.pictures.pop("delta")
            view.edges, view.moved = {}, {}
        for k, name in enumerate(self.planes.objects):
            shape = wanted.get(name, EdgeShape())
            if shape != view.edges.get(name, EdgeShape()):
                if k not in self.movable:
                    self.movable[k] = edges.MovableObject(scene, self.planes, k)
                part, *pixels = self.movable[k].shaped(scene.karf.objects[name], shape)
                if view.moved.get(k) is part:
                    view._picture("delta")[0].retouch(k, *pixels)
                else:
                    view._picture("delta")[0].reshape(k, part)
                    view.moved[k] = part
                view.edges[name] = shape

    def _picture(self, compositing: str) -> tuple[SwatchPicture, np.ndarray]:
        """The picture of one compositing, and its buffer."""
        if compositing not in self.pictures:
            height, width = self.planes.base.shape[:2]
            buffer = images.blank(width, height)
            follow = paper_picture if compositing == "paper" else delta_picture
            self.pictures[compositing] = follow(self.planes, images.upright(buffer)), buffer
        return self.pictures[compositing]


# --- how it is looked at -------------------------------------------------------------------------------------------
@dataclass
class PictureFiles:
    """Pictures of how the engine sees the active view, each read once."""

    # by what they are of: their files with the times of these, and the brightest of them in each pixel
    known: dict[str, tuple[list[tuple[Path, int]], np.ndarray]] = field(default_factory=dict)

    def read(self, kind: str, files: Sequence[Path]) -> np.ndarray:
        """The pictures of a kind as one, [h, w, 3]."""
        key = [(file, file.stat().st_mtime_ns) for file in files]
        if kind not in self.known or self.known[kind][0] != key:
            self.known[kind] = key, np.max([images.read_picture(file) for file in files], axis=0)
        return self.known[kind][1]


def key() -> tuple:
    """The settings that pictures depend on."""
    seeing = bpy.context.window_manager.karf_seeing
    solo = seeing.solo_object, seeing.solo_swatch
    return seeing.mode, *solo, seeing.is_wiped, seeing.wipe, seeing.show_masks


def picture(scene: bpy.types.Scene, view: DisplayedView, files: PictureFiles) -> np.ndarray:
    """A view as it is looked at.

    Args:
        scene: The scene, whose swatches recolor it.
        view: The active view, or a free camera.
        files: How the engine sees the active view.

    Returns:
        RGBA buffer [H, W, 4] float32 in Blender's row order; overwritten by the next call.

    Raises:
        KarfError: The planes belong to other palettes.
    """
    seeing = bpy.context.window_manager.karf_seeing
    edited = view.recolored(scene)
    mode = seeing.mode if view.planes.palette_weights.shape[1] else "EDITED"
    if mode == "EDITED" and not seeing.is_wiped:
        return edited
    width = edited.shape[1]
    if view.canvas is None:
        view.canvas = images.blank(width, len(edited))
    line = round(seeing.wipe * width) if seeing.is_wiped else 0
    if mode == "EDITED":  # a swatch may be being dragged: whole pixels are copied fastest
        view.canvas[:, line:] = edited[:, line:]
    else:
        images.upright(view.canvas)[:, line:] = SIDES[mode](scene, view, files)[:, line:]
    if view.split_at != line:
        images.upright(view.canvas)[:, :line] = _original(scene, view, files)[:, :line]
        view.split_at = line
    return view.canvas


def placeholder(scene: bpy.types.Scene, files: PictureFiles) -> np.ndarray:
    """What is shown of a view that cannot be recolored, as `picture` returns it: its photo, or what is learned of it.

    Black where nothing can be read.
    """
    try:
        rendering = _rendering(scene, files) if _mode() == "LEARNED" else None
        shown = _photo(scene) if rendering is None else rendering
        if shown is not None and _mode() == "UNSURE":
            shown = _with_doubts(scene, shown, files)
    except KarfError:
        shown = None
    if shown is None:
        return images.blank(*(scene.karf.result.size if scene.karf.result else (1, 1)))
    buffer = images.blank(shown.shape[1], shown.shape[0])
    images.upright(buffer)[:] = shown
    return buffer


def placeholder_key(scene: bpy.types.Scene) -> tuple:
    """What a stand-in depends on."""
    return scene.karf.active_view, _mode(), bpy.context.window_manager.karf_seeing.show_masks


def difference(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """CIEDE2000 of two pictures [H, W, 3] sRGB, [H, W]; of large ones in every second pixel, or third."""
    step = max(1, ceil(sqrt(first.shape[0] * first.shape[1] / COMPARED_PIXELS)))
    near, far = first[::step, ::step], second[::step, ::step]
    result = np.zeros(near.shape[:2], np.float32)
    changed = (near != far).any(axis=-1)
    result[changed] = ciede2000(srgb_to_lab(near[changed]), srgb_to_lab(far[changed]))
    return result.repeat(step, axis=0).repeat(step, axis=1)[: first.shape[0], : first.shape[1]]


def heat(values: np.ndarray) -> np.ndarray:
    """The heat map's colors [..., 3] of CIEDE2000 values [...]."""
    anchors = np.linspace(0, HOTTEST, len(HEAT))
    return np.stack([np.interp(values, anchors, HEAT[:, channel]) for channel in range(3)], -1).astype(np.float32)


# --- the sides of a picture, [H, W, 3] or [H, W, 1] sRGB in [0, 1] --------------------------------------------------
def _original(scene: bpy.types.Scene, view: DisplayedView, files: PictureFiles) -> np.ndarray:
    del scene, files
    return view.planes.base.astype(np.float32) / np.float32(255)


def _learned(scene: bpy.types.Scene, view: DisplayedView, files: PictureFiles) -> np.ndarray:
    rendering = None if view.is_free else _rendering(scene, files)
    if rendering is None:  # the base is it, or the panel says that there is none
        return _original(scene, view, files)
    return images.resized(rendering, *view.planes.base.shape[1::-1])


def _weights(scene: bpy.types.Scene, view: DisplayedView, files: PictureFiles) -> np.ndarray:
    del files
    seeing = bpy.context.window_manager.karf_seeing
    shown = view.spread(scene).planes
    k = shown.objects.index(seeing.solo_object) if seeing.solo_object in shown.objects else 0
    if seeing.solo_swatch == 0:
        share = shown.probabilities[k].astype(np.float32)[..., None]
        return (DIMMED + (1 - DIMMED) * share) * images.upright(view.recolored(scene))
    number = min(seeing.solo_swatch, shown.palette_weights.shape[1] - 1)
    state = colors.state(scene.karf.objects[shown.objects[k]])
    is_set = number < len(state.is_added) and state.is_added[number]  # then its swatches together are its pigment
    weights = shown.palette_weights[k, number : number + (state.size if is_set else 1)]
    return weights.sum(axis=0, dtype=np.float32)[..., None]


def _difference(scene: bpy.types.Scene, view: DisplayedView, files: PictureFiles) -> np.ndarray:
    return heat(difference(images.upright(view.recolored(scene)), _original(scene, view, files)))


def _unsure(scene: bpy.types.Scene, view: DisplayedView, files: PictureFiles) -> np.ndarray:
    photo = _original(scene, view, files)
    return photo if view.is_free else _with_doubts(scene, photo, files)


SIDES: dict[str, Callable[[bpy.types.Scene, DisplayedView, PictureFiles], np.ndarray]] = {
    "ORIGINAL": _original,
    "LEARNED": _learned,
    "WEIGHTS": _weights,
    "DIFFERENCE": _difference,
    "UNSURE": _unsure,
}


# --- files ---------------------------------------------------------------------------------------------------------
def _mode() -> str:
    return bpy.context.window_manager.karf_seeing.mode


def _with_doubts(scene: bpy.types.Scene, photo: np.ndarray, files: PictureFiles) -> np.ndarray:
    """A dimmed photo [H, W, 3] of the active view with what is unsure in it; as it is where nothing was rendered since."""
    doubts = contents.seen_doubts(scene)
    if not doubts:
        return photo
    doubt = images.resized(files.read("doubts", doubts), *photo.shape[1::-1])
    return (1 - doubt) * DIMMED * photo + doubt * UNSURE


def _rendering(scene: bpy.types.Scene, files: PictureFiles) -> np.ndarray | None:
    """What is learned of the active view, rendered, [h, w, 3]; None where it was not rendered since."""
    file = contents.seen_rendering(scene)
    return None if file is None else files.read("rendering", [file])


def _photo(scene: bpy.types.Scene) -> np.ndarray | None:
    """The active view's photo, [h, w, 3]; under masks and doubts as its pinhole shows it, as they are."""
    view = captures.view_of(scene)
    if view.image is None:
        return None
    is_covered = bpy.context.window_manager.karf_seeing.show_masks or _mode() == "UNSURE"
    if is_covered and not photos.is_shown_as_stored(view):
        return images.read_picture(photos.straightened(view, folders.project_of(scene).photos_folder), PHOTO_SIDE)
    return photos.read(view, PHOTO_SIDE)
