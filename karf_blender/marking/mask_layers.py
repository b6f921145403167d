"""The mask layers of the photo to mark, in memory: read from their files and written back.

A layer is [H, W] int8: of a mask 1 for the object, else 0; of a correction 1 "object", -1 "not the object", 0 neither.
"""

from dataclasses import dataclass, field
from pathlib import Path

import bpy
import numpy as np

from .. import session
from ..engine_api import View, check_file, masks_of_view
from ..host import windows
from ..pictures import images
from ..progress import printing_errors
from ..project import captures, folders
from . import history, objects, raster


@dataclass
class Layer:
    pixels: np.ndarray  # of one mask or correction
    version: object = field(default_factory=object)  # another one whenever the pixels change

    def touch(self) -> None:
        self.version = object()


@dataclass
class MaskLayers:
    view: View
    masks: dict[str, Layer]  # by object
    corrections: dict[str, Layer]
    solved: dict[str, Layer] = field(default_factory=dict)  # the engine's masks with all corrections, once they come

    @property
    def size(self) -> tuple[int, int]:
        return self.view.camera.width, self.view.camera.height

    def layer(self, name: str, is_correction: bool) -> Layer:
        """Return an object's mask or correction, an empty one if missing."""
        layers = self.corrections if is_correction else self.masks
        return layers.setdefault(name, Layer(np.zeros(self.size[::-1], np.int8)))


@dataclass
class _Opened:
    per_file = True
    layers: MaskLayers | None = None
    key: tuple = ()  # what they were read for


def _key(scene: bpy.types.Scene) -> tuple:
    karf = scene.karf
    return bpy.data.filepath, karf.capture, karf.project, karf.masks, karf.active_view


def opened(scene: bpy.types.Scene) -> MaskLayers | None:
    """Return the mask layers of the scene's active view if they are open; for drawing."""
    state = session.get(_Opened)
    return state.layers if state.key == _key(scene) else None


def open_layers(scene: bpy.types.Scene) -> MaskLayers:
    """Return the layers of the active view, read if they are not open; KarfError if a mask cannot be read."""
    state = session.get(_Opened)
    if opened(scene) is None:
        view = captures.view_of(scene)
        masks, corrections = objects.mark_folders(scene)
        state.layers = MaskLayers(
            view, _read_all(scene, masks, view, _read_mask), _read_all(scene, corrections, view, _read_correction)
        )
        state.key = _key(scene)
    return state.layers


def reread(scene: bpy.types.Scene) -> None:
    """Read open mask layers again after undo or another stroke has changed their files."""
    was_open = opened(scene) is not None
    forget()
    if was_open:
        with printing_errors():
            open_layers(scene)
    windows.redraw()


def forget() -> None:
    session.get(_Opened).layers = None


def save(scene: bpy.types.Scene, name: str, is_correction: bool) -> None:
    """Write an object's open mask or correction as a step that undo takes back. Raises OSError."""
    layers = open_layers(scene)
    pixels = layers.layer(name, is_correction).pixels
    if is_correction:
        root = folders.project_of(scene).corrections_folder
        # white: the object; black: not the object; transparent: neither
        gray_alpha = np.stack([pixels > 0, pixels != 0], -1) * np.uint8(255)
        content = raster.encode_png(gray_alpha) if pixels.any() else None
        files = {root / name / f"{layers.view.name}.png": content}
    else:
        root, files = objects.masks_folder(scene), mask_files(scene, layers.view, name, pixels)
    history.record(scene, root, files)


def mask_files(scene: bpy.types.Scene, view: View, name: str, pixels: np.ndarray) -> dict[Path, bytes | None]:
    """Return the contents of the files of an object's mask; an empty mask has no file."""
    folder = objects.masks_folder(scene) / name
    found = masks_of_view(folder, view)
    file = (found or [folder / f"{view.name}.png"])[0].with_suffix(".png")
    gray = np.where(pixels > 0, 255, 0).astype(np.uint8)[..., None]
    return {**dict.fromkeys(found), file: raster.encode_png(gray) if pixels.any() else None}


def _read_all(scene: bpy.types.Scene, root: Path, view: View, read) -> dict[str, Layer]:
    """Return the layers of the objects that have a file for the view."""
    names = [item.folder for item in scene.karf.marking.objects]
    found = {name: files[0] for name in names if (files := masks_of_view(root / name, view))}
    for file in found.values():
        check_file(file)  # no folder, pipe or device
    return {name: Layer(_fitted(read(file), view)) for name, file in found.items()}


def _read_mask(file: Path) -> np.ndarray:
    own = raster.decode_png(file.read_bytes())
    is_plain = own is not None and own.shape[-1] == 1 and own.max() == 255
    return own[..., 0] > 127 if is_plain else images.read_mask(file)


def _read_correction(file: Path) -> np.ndarray:
    own = raster.decode_png(file.read_bytes())
    if own is None or own.shape[-1] == 1:
        return images.read_correction(file)
    return np.where(own[..., 1] > 127, np.where(own[..., 0] > 127, 1, -1), 0)


def _fitted(pixels: np.ndarray, view: View) -> np.ndarray:
    """Resize a mask to the photo: it may also have the size of the training images."""
    size = view.camera.height, view.camera.width
    if pixels.shape == size:
        return pixels.astype(np.int8)
    rows, columns = (np.arange(want) * have // want for want, have in zip(size, pixels.shape, strict=True))
    return pixels[np.ix_(rows, columns)].astype(np.int8)
