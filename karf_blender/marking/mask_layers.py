"""The mask layers of the photo that is being marked, in memory: read from their files and written back.

A layer is [H, W] int8: of a mask 1 where the object is, else 0; of a correction 1 "this is it", -1 "this is not",
0 unsaid.
"""

import itertools
from dataclasses import dataclass, field
from pathlib import Path

import bpy
import numpy as np

from .. import session
from ..engine_api import KarfError, View, check_file, masks_of_view
from ..host import windows
from ..pictures import images
from ..project import captures
from . import history, objects, png

_versions = itertools.count(1)


@dataclass
class Layer:
    """One mask or correction. version: another one whenever the pixels are."""

    pixels: np.ndarray
    version: int = field(default_factory=lambda: next(_versions))

    def touch(self) -> None:
        """The pixels were changed."""
        self.version = next(_versions)


@dataclass
class MaskLayers:
    """One photo's layers.

    Attributes:
        view: The photo's.
        masks: Of each object that has one in this view, and of the one being marked.
        corrections: The same.
        solved: The engine's masks of the view with all corrections, once it has answered.
    """

    view: View
    masks: dict[str, Layer]
    corrections: dict[str, Layer]
    solved: dict[str, Layer] = field(default_factory=dict)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the photo."""
        return self.view.camera.width, self.view.camera.height

    def layer(self, name: str, is_correction: bool) -> Layer:
        """An object's mask or correction, made where it has none."""
        layers = self.corrections if is_correction else self.masks
        return layers.setdefault(name, Layer(np.zeros(self.size[::-1], np.int8)))


@dataclass
class _State:
    """The mask layers of the scene that was marked last, and what they were read for."""

    layers: MaskLayers | None = None
    key: tuple = ()


def _key(scene: bpy.types.Scene) -> tuple:
    karf = scene.karf
    return bpy.data.filepath, karf.capture, karf.project, karf.masks, karf.active_view


def shown(scene: bpy.types.Scene) -> MaskLayers | None:
    """The mask layers of the scene's active view, where they are open; drawing asks this."""
    return session.get(_State).layers if session.get(_State).key == _key(scene) else None


def open_layers(scene: bpy.types.Scene) -> MaskLayers:
    """The mask layers of the scene's active view, read where they are not open.

    Raises:
        KarfError: There is no such view, or a mask cannot be read.
    """
    if shown(scene) is None:
        view = captures.view_of(scene)
        names = [item.folder for item in scene.karf.marking.objects]
        masks, corrections = objects.masks_folder(scene), objects.corrections_folder(scene)
        session.get(_State).layers = MaskLayers(
            view,
            {name: Layer(_fitted(_read_mask(file), view)) for name, file in _found(masks, names, view)},
            {name: Layer(_fitted(_read_correction(file), view)) for name, file in _found(corrections, names, view)},
        )
        session.get(_State).key = _key(scene)
    return session.get(_State).layers


def _found(root: Path, names: list[str], view: View) -> list[tuple[str, Path]]:
    """The objects that have a file for the view, each with it."""
    return [(name, files[0]) for name in names if (files := masks_of_view(root / name, view))]


def _decoded(file: Path) -> np.ndarray | None:
    """What `png.decode` gives of a file. Raises DataError where it is a folder, a pipe or a device."""
    check_file(file)
    return png.decode(file.read_bytes())


def _read_mask(file: Path) -> np.ndarray:
    own = _decoded(file)
    is_plain = own is not None and own.shape[-1] == 1 and own.max() == 255
    return own[..., 0] > 127 if is_plain else images.read_mask(file)


def _read_correction(file: Path) -> np.ndarray:
    own = _decoded(file)
    if own is None or own.shape[-1] == 1:
        return images.read_correction(file)
    return np.where(own[..., 1] > 127, np.where(own[..., 0] > 127, 1, -1), 0)


def _fitted(pixels: np.ndarray, view: View) -> np.ndarray:
    """Pixels at the photo's size: a mask may also have the size that is learned from."""
    size = view.camera.height, view.camera.width
    if pixels.shape == size:
        return pixels.astype(np.int8)
    rows, columns = (np.arange(want) * have // want for want, have in zip(size, pixels.shape, strict=True))
    return pixels[np.ix_(rows, columns)].astype(np.int8)


def _named(folder: Path, name: str, view: View) -> Path:
    return folder / name / f"{view.name}.png"


def save(scene: bpy.types.Scene, name: str, is_correction: bool) -> None:
    """Write an object's open mask or correction, as a step that undo takes back.

    Raises:
        OSError: The file cannot be written.
    """
    opened = open_layers(scene)
    pixels = opened.layer(name, is_correction).pixels
    history.record(scene, root_of(scene, is_correction), files_of(scene, opened.view, name, is_correction, pixels))


def root_of(scene: bpy.types.Scene, is_correction: bool) -> Path:
    """The folder of corrections or of masks."""
    return objects.corrections_folder(scene) if is_correction else objects.masks_folder(scene)


def files_of(
    scene: bpy.types.Scene, view: View, name: str, is_correction: bool, pixels: np.ndarray
) -> dict[Path, bytes | None]:
    """What the files of an object's mask or correction must hold for these pixels; an empty one has no file."""
    root = root_of(scene, is_correction)
    found = [] if is_correction else masks_of_view(root / name, view)
    file = (found or [_named(root, name, view)])[0].with_suffix(".png")
    encode = encode_correction if is_correction else encode_mask
    return {**dict.fromkeys(found), file: encode(pixels) if pixels.any() else None}


def encode_mask(pixels: np.ndarray) -> bytes:
    """A mask's layer as a PNG: white where the object is."""
    return png.encode(np.where(pixels > 0, 255, 0).astype(np.uint8)[..., None])


def encode_correction(pixels: np.ndarray) -> bytes:
    """A correction's layer as a PNG: white this is it, black this is not, transparent unsaid."""
    return png.encode(np.stack([pixels > 0, pixels != 0], -1) * np.uint8(255))


def follow(scene: bpy.types.Scene) -> None:
    """What is drawn over the photo may have changed: draw it again."""
    windows.redraw(*windows.PANEL_AREAS)


def reread(scene: bpy.types.Scene) -> None:
    """Read the mask layers again, where they are open: undo, or another stroke, has changed their files."""
    was_open = shown(scene) is not None
    forget()
    if was_open:
        try:
            open_layers(scene)
        except (KarfError, OSError) as error:
            print(f"KaRF: the masks of {scene.karf.active_view!r} cannot be read: {error}")
    follow(scene)


def forget() -> None:
    """Close the mask layers."""
    session.get(_State).layers, session.get(_State).key = None, ()
