"""Views: their edit planes, and the picture that these make with the swatches, the edited one or another side of it."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import ceil, sqrt
from pathlib import Path

import bpy
import numpy as np

from ..engine_api import (
    DataError,
    EdgeShape,
    KarfError,
    ObjectEdge,
    ObjectPlanes,
    Planes,
    SwatchPicture,
    apply_edges_to_planes,
    ciede2000,
    delta_picture,
    paper_picture,
    split_weights_of_objects,
    srgb_to_lab,
    stack_palettes,
    to_mean_exposure,
    to_photo_exposure,
)
from ..pictures import images, photos
from ..project import captures, disk, folders
from . import colors
from .object_masks import ObjectMasks

PHOTO_SIDE = 800  # pixels at most of the placeholder of a view that is not prepared
COMPARED_PIXELS = 160_000  # of a difference picture: larger ones are compared in every second pixel, or third
HOTTEST = 20.0  # CIEDE2000 where the heat map is white
UNSURE = np.array([1.0, 0.55, 0.04], np.float32)  # color of unsure pixels
DIMMED = np.float32(0.4)  # factor of the rest of the picture
HEAT = np.array([[0, 0, 0.05], [0.33, 0.06, 0.43], [0.73, 0.21, 0.33], [0.98, 0.55, 0.04], [1, 1, 0.75]], np.float32)


@dataclass(eq=False)
class DisplayedView:
    """Planes of one view, ready for compositing."""

    file: Path
    written: int  # the file's time, in nanoseconds
    planes: Planes
    is_free: bool = False  # a camera without a photo: the base is what is learned
    masks: ObjectMasks | None = None  # None until painted
    pictures: dict[str, tuple[SwatchPicture, np.ndarray]] = field(default_factory=dict)  # by compositing, with buffers
    movable: dict[int, "_MovableObject"] = field(default_factory=dict)  # objects whose edges were changed, by number
    moved: dict[int, ObjectPlanes] = field(default_factory=dict)  # their parts of the delta picture
    edges: dict[str, EdgeShape] = field(default_factory=dict)  # moved or faded in the delta picture, by object
    with_edges: dict[str, "DisplayedView"] = field(default_factory=dict)  # by edges, those asked for last
    with_sets: dict[str, "DisplayedView"] = field(default_factory=dict)  # by added colors, those asked for last
    canvas: np.ndarray | None = None  # RGBA buffer of a picture that is not just the edited one
    split_at: int = 0  # the canvas has the original left of this column

    def recolored(self, scene: bpy.types.Scene) -> np.ndarray:
        """Recolor the view by a scene's swatches; planes without palettes show their base.

        Return an RGBA buffer [H, W, 4] float32 in Blender's row order, which the next call overwrites. Raises DataError
        if the planes belong to other palettes.
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
        """Return the view with weights spread over the sets of added colors. Raises DataError with other palettes."""
        objects, learned = self.planes.objects, {palette.name: palette for palette in colors.palettes(scene)}
        if set(objects) != set(learned):
            raise DataError(
                "{file} was made for the objects {objects}.",
                "Extract the palettes again.",
                file=self.file,
                objects=", ".join(objects),
            )
        if max(len(palette.colors) for palette in learned.values()) != self.planes.palette_weights.shape[1]:
            raise DataError("{file} was made for other palettes.", "Press Prepare in step 4.", file=self.file)
        added = {name: each.added for name, each in colors.states(scene).items() if each.added}
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
        """Return the view with objects that end where the scene's edges do, if there are such."""
        wanted = colors.edges(scene)
        if not wanted:
            return self
        if repr(wanted) not in self.with_edges:
            self.with_edges.clear()
            planes = self.planes
            palettes = {palette.name: palette for palette in colors.palettes(scene)}
            ordered = [palettes[name] for name in planes.objects]
            learned = to_mean_exposure(planes.base, planes.gains), planes.palette_weights, planes.probabilities
            weights, shares = apply_edges_to_planes(*learned, ordered, wanted, _scale_of(scene, planes))
            planes = dataclasses.replace(planes, palette_weights=weights, probabilities=shares)
            self.with_edges[repr(wanted)] = DisplayedView(self.file, self.written, planes)
        return self.with_edges[repr(wanted)]

    def _move_edges(self, scene: bpy.types.Scene, view: "DisplayedView") -> None:
        """Move the edges of objects in the picture of `view`, which is this one spread, to the scene's."""
        wanted = colors.edges(scene)
        if view.edges and not wanted:  # begun anew it has the planes' own bits
            view.pictures.pop("delta")
            view.edges, view.moved = {}, {}
        for k, name in enumerate(self.planes.objects):
            shape = wanted.get(name, EdgeShape())
            if shape != view.edges.get(name, EdgeShape()):
                if k not in self.movable:
                    self.movable[k] = _MovableObject(scene, self.planes, k)
                part, *pixels = self.movable[k].shaped(scene.karf.objects[name], shape)
                if view.moved.get(k) is part:
                    view._picture("delta")[0].retouch(k, *pixels)
                else:
                    view._picture("delta")[0].reshape(k, part)
                    view.moved[k] = part
                view.edges[name] = shape

    def _picture(self, compositing: str) -> tuple[SwatchPicture, np.ndarray]:
        """Return the picture that follows the swatches, and the RGBA buffer that it writes to."""
        if compositing not in self.pictures:
            height, width = self.planes.base.shape[:2]
            buffer = images.blank(width, height)
            follow = paper_picture if compositing == "paper" else delta_picture
            self.pictures[compositing] = follow(self.planes, images.upright(buffer)), buffer
        return self.pictures[compositing]


# --- edges ---------------------------------------------------------------------------------------------------------
class _MovableObject:
    """Object k of planes with an edge of any shape, and its part of a picture, changed in place."""

    def __init__(self, scene: bpy.types.Scene, planes: Planes, k: int) -> None:
        self._planes, self._k, self._scale = planes, k, _scale_of(scene, planes)
        self._known: tuple[str, ObjectEdge, ObjectPlanes] | None = None

    def shaped(self, item: bpy.types.PropertyGroup, shape: EdgeShape) -> tuple[ObjectPlanes, np.ndarray, np.ndarray]:
        """Return the part with an edge of this shape (another with other added colors), its changed pixels and planes."""
        key = repr(colors.keys(colors.added(item)))
        if self._known is None or self._known[0] != key:
            edge = self._edge(item)
            self._known = key, edge, ObjectPlanes(*((each.start, each.stop) for each in edge.place), edge.weights)
        _, edge, part = self._known
        return part, *edge.shaped(shape)[1:]

    def _edge(self, item: bpy.types.PropertyGroup) -> ObjectEdge:
        planes, k = self._planes, self._k
        probabilities = planes.probabilities.astype(np.float32)
        room = 1 - (probabilities.sum(axis=0) - probabilities[k])
        palette = colors.state(item).palette.colors
        base = to_mean_exposure(planes.base, planes.gains)
        learned = base, planes.palette_weights[k, : len(palette)], probabilities[k]
        return ObjectEdge(*learned, room, palette, self._scale, colors.added(item))


def _scale_of(scene: bpy.types.Scene, planes: Planes) -> float:
    """Return the ratio of the long sides of planes and photos; 1 where the capture cannot be read."""
    try:
        cameras = [view.camera for view in captures.of(scene).views]
    except KarfError:
        return 1.0
    return max(planes.base.shape[:2]) / float(np.median([max(each.width, each.height) for each in cameras]))


# --- pictures ------------------------------------------------------------------------------------------------------
@dataclass
class PictureFiles:
    """Pictures of how the engine sees the active view, each kind read once."""

    known: dict[str, tuple[list[tuple[Path, int]], np.ndarray]] = field(default_factory=dict)  # with files and times

    def read(self, kind: str, files: Sequence[Path]) -> np.ndarray:
        """Return the brightest of the pictures of a kind in each pixel, [h, w, 3]."""
        key = [(file, file.stat().st_mtime_ns) for file in files]
        if kind not in self.known or self.known[kind][0] != key:
            self.known[kind] = key, np.max([images.read_picture(file) for file in files], axis=0)
        return self.known[kind][1]


def _seeing() -> bpy.types.PropertyGroup:
    return bpy.context.window_manager.karf_seeing


def key() -> tuple:
    """Return the settings that pictures depend on."""
    seeing = _seeing()
    return seeing.mode, seeing.solo_object, seeing.solo_swatch, seeing.is_wiped, seeing.wipe, seeing.show_masks


def picture(scene: bpy.types.Scene, view: DisplayedView, files: PictureFiles) -> np.ndarray:
    """Return a view as `karf_seeing` says, in a buffer like `recolored`. Raises KarfError with other palettes' planes."""
    seeing = _seeing()
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
        images.upright(view.canvas)[:, line:] = _side(mode, scene, view, files)[:, line:]
    if view.split_at != line:
        images.upright(view.canvas)[:, :line] = _original(view)[:, :line]
        view.split_at = line
    return view.canvas


def placeholder(scene: bpy.types.Scene, files: PictureFiles) -> np.ndarray:
    """Return the buffer of a view that cannot be recolored: its photo or what is learned of it; black without files."""
    mode = _seeing().mode
    try:
        rendering = _rendering(scene, files) if mode == "LEARNED" else None
        pixels = _photo(scene) if rendering is None else rendering
        if pixels is not None and mode == "UNSURE":
            pixels = _with_doubts(scene, pixels, files)
    except KarfError:
        pixels = None
    if pixels is None:
        return images.blank(*(scene.karf.result.size if scene.karf.result else (1, 1)))
    buffer = images.blank(pixels.shape[1], pixels.shape[0])
    images.upright(buffer)[:] = pixels
    return buffer


def placeholder_key(scene: bpy.types.Scene) -> tuple:
    """Return what a placeholder depends on."""
    return scene.karf.active_view, _seeing().mode, _seeing().show_masks


def difference(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return CIEDE2000 of two pictures [H, W, 3] sRGB, [H, W]; of large ones in every second pixel, or third."""
    step = max(1, ceil(sqrt(first.shape[0] * first.shape[1] / COMPARED_PIXELS)))
    near, far = first[::step, ::step], second[::step, ::step]
    result = np.zeros(near.shape[:2], np.float32)
    changed = (near != far).any(axis=-1)
    result[changed] = ciede2000(srgb_to_lab(near[changed]), srgb_to_lab(far[changed]))
    return result.repeat(step, axis=0).repeat(step, axis=1)[: first.shape[0], : first.shape[1]]


def heat(values: np.ndarray) -> np.ndarray:
    """Return the heat map's colors [..., 3] of CIEDE2000 values [...]."""
    anchors = np.linspace(0, HOTTEST, len(HEAT))
    return np.stack([np.interp(values, anchors, HEAT[:, channel]) for channel in range(3)], -1).astype(np.float32)


# --- the sides of a picture, [H, W, 3] or [H, W, 1] sRGB in [0, 1] --------------------------------------------------
def _side(mode: str, scene: bpy.types.Scene, view: DisplayedView, files: PictureFiles) -> np.ndarray:
    if mode == "WEIGHTS":
        return _weights(scene, view)
    original = _original(view)
    if mode == "DIFFERENCE":
        return heat(difference(images.upright(view.recolored(scene)), original))
    if view.is_free:  # it has no files, and its base is what is learned
        return original
    if mode == "UNSURE":
        return _with_doubts(scene, original, files)
    rendering = _rendering(scene, files) if mode == "LEARNED" else None
    return original if rendering is None else images.resized(rendering, *view.planes.base.shape[1::-1])


def _original(view: DisplayedView) -> np.ndarray:
    return view.planes.base.astype(np.float32) / np.float32(255)


def _weights(scene: bpy.types.Scene, view: DisplayedView) -> np.ndarray:
    seeing, planes = _seeing(), view.spread(scene).planes
    k = planes.objects.index(seeing.solo_object) if seeing.solo_object in planes.objects else 0
    if seeing.solo_swatch == 0:
        share = planes.probabilities[k].astype(np.float32)[..., None]
        return (DIMMED + (1 - DIMMED) * share) * images.upright(view.recolored(scene))
    number = min(seeing.solo_swatch, planes.palette_weights.shape[1] - 1)
    state = colors.state(scene.karf.objects[planes.objects[k]])
    is_set = number < len(state.is_added) and state.is_added[number]  # then its swatches together are its pigment
    weights = planes.palette_weights[k, number : number + (state.size if is_set else 1)]
    return weights.sum(axis=0, dtype=np.float32)[..., None]


def _with_doubts(scene: bpy.types.Scene, photo: np.ndarray, files: PictureFiles) -> np.ndarray:
    """Dim a photo [H, W, 3] of the active view and mark unsure pixels, if those were rendered."""
    doubts = disk.rendered_doubts(scene)
    if not doubts:
        return photo
    doubt = images.resized(files.read("doubts", doubts), *photo.shape[1::-1])
    return (1 - doubt) * DIMMED * photo + doubt * UNSURE


def _rendering(scene: bpy.types.Scene, files: PictureFiles) -> np.ndarray | None:
    """Return the rendering of what is learned of the active view, [h, w, 3]; None where it is out of date."""
    file = disk.rendering_of(scene)
    return None if file is None else files.read("rendering", [file])


def _photo(scene: bpy.types.Scene) -> np.ndarray | None:
    """Return the active view's photo, [h, w, 3]; under masks and doubts without lens distortion, as they are."""
    view, folder = captures.view_of(scene), folders.project_of(scene).photos_folder
    view = photos.readable(view, folder) if view.image else None
    if view is None:
        return None
    is_covered = _seeing().show_masks or _seeing().mode == "UNSURE"
    if is_covered and not photos.is_shown_as_stored(view):
        return images.read_picture(photos.straightened(view, folder), PHOTO_SIDE)
    return photos.read(view, PHOTO_SIDE)
