"""One view in many colorways."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ..capture.capture import View
from ..io.images import write_png
from ..palettes.calibration import to_mean_exposure
from ..palettes.matching.becomes import is_near
from ..palettes.palette import Edit
from ..palettes.prediction import Prediction, reached_color
from ..recolor.frames import Frame
from ..recolor.model import Model
from ..recolor.photos import StoredPhoto, suffix_for, write_photo

SURE = 0.9  # coverage above which a pixel counts as the object's alone
MAX_PROBES = 50_000  # pixels per object and view
Pixels = tuple[np.ndarray, np.ndarray]  # rows and columns, [n] each


class RecolorableView(Protocol):
    """A view that can be recolored. suffix: of its files; disputed: see `Frame.disputed`."""

    suffix: str
    disputed: tuple[str, ...]

    def recolored(self, edits: Sequence[Edit]) -> Iterator[Any]:
        """Yield a picture for each edit."""
        ...

    def write(self, path: Path, picture: Any) -> None:
        """Write a picture."""

    def colors(self, pixels: Pixels, picture: Any = None) -> np.ndarray:
        """Return sRGB colors [n, 3] of a picture, by default the unedited one, in the photos' mean exposure."""
        ...

    def covered(self, name: str) -> Pixels:
        """Return the pixels that are surely an object's."""
        ...


def pictures_of(model: Model, view: View, size: str | int, captured: bool) -> RecolorableView:
    """Prepare a captured view at a size (`photo`, `learned`, or pixels), or the view of any camera."""
    if not captured:
        return FramePictures(model, model.render(view.camera, model.settings.render.supersampling))
    if size == "learned":
        return FramePictures(model, model.preview(view, model.settings.geometry.long_side))
    return PhotoPictures(model, view, size)


class PhotoPictures:
    """A captured view in its photo's own pixels, written in the photo's format."""

    def __init__(self, model: Model, view: View, size: str | int) -> None:
        self._view = model.photo_view(view, size)
        self.suffix, self.disputed = suffix_for(self._view.photo), self._view.disputed

    def recolored(self, edits: Sequence[Edit]) -> Iterator[StoredPhoto]:
        return self._view.recolor_all(edits)

    def write(self, path: Path, picture: StoredPhoto) -> None:
        write_photo(path, picture)

    def colors(self, pixels: Pixels, picture: StoredPhoto | None = None) -> np.ndarray:
        rows, columns = (numbers[:, None] for numbers in pixels)
        return to_mean_exposure((picture or self._view.photo).colors(rows, columns)[:, 0], self._view.gains)

    def covered(self, name: str) -> Pixels:
        matte = self._view.mattes[list(self._view.objects).index(name)]
        rows, columns = np.nonzero(matte.coverage > SURE)
        return rows + matte.rows[0], columns + matte.columns[0]


class FramePictures:
    """A rendered frame, written as 8-bit PNG."""

    suffix = ".png"

    def __init__(self, model: Model, frame: Frame) -> None:
        self._model, self._frame, self.disputed = model, frame, frame.disputed

    def recolored(self, edits: Sequence[Edit]) -> Iterator[np.ndarray]:
        return (self._model.composite(self._frame, edit) for edit in edits)

    def write(self, path: Path, picture: np.ndarray) -> None:
        write_png(path, picture)

    def colors(self, pixels: Pixels, picture: np.ndarray | None = None) -> np.ndarray:
        return to_mean_exposure((self._frame.base if picture is None else picture)[pixels], self._frame.gains)

    def covered(self, name: str) -> Pixels:
        rows, columns = np.nonzero(self._frame.probabilities[self._model.objects.index(name)] > SURE)
        return rows, columns


class ColorProbe:
    """Color measurements in the pixels of a view that are surely an object's, near a source color."""

    def __init__(self, pictures: RecolorableView) -> None:
        self._pictures = pictures
        self._known: dict[tuple[str, bytes], tuple[Pixels, np.ndarray]] = {}

    def measure(self, picture: Any, prediction: Prediction) -> list[float] | None:
        """Return the new sRGB color of the source color in a recolored picture, and the number of pixels, or None."""
        pixels, before = self._pixels_near(prediction.target_color.name, prediction.source)
        if not len(before):
            return None
        color = reached_color(before, self._pictures.colors(pixels, picture), prediction.source)
        return [*color.round(5).tolist(), len(before)]

    def _pixels_near(self, name: str, source: np.ndarray) -> tuple[Pixels, np.ndarray]:
        """Return pixels of a color, and their colors before the edit [n, 3]."""
        key = (name, source.tobytes())
        if key not in self._known:
            rows, columns = self._pictures.covered(name)
            step = len(rows) // MAX_PROBES + 1
            rows, columns = rows[::step], columns[::step]
            before = self._pictures.colors((rows, columns))
            nearby = is_near(before, source, or_nearest=False)
            self._known[key] = (rows[nearby], columns[nearby]), before[nearby]
        return self._known[key]
