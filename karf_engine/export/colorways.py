"""Colorways: one view in many of them, a contact sheet, and tables of the wanted, predicted and reached colors."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ..capture.capture import View
from ..io.color import ciede2000, srgb_to_lab, to_bytes
from ..io.color_spaces import ColorSpace
from ..io.files import atomic_write
from ..io.images import alpha_composite, read_photo, resize, write_png
from ..palettes.calibration import ReferenceLight, to_mean_exposure
from ..palettes.colorways import PlannedColorway
from ..palettes.matching.becomes import is_near
from ..palettes.palette import Edit, rgb_to_hex
from ..palettes.prediction import Prediction, reached_color, reason_in_view
from ..recolor.frames import Frame
from ..recolor.model import Model
from ..recolor.photos import suffix_for, write_photo

SURE = 0.9  # coverage above which a pixel counts as the object's alone
MAX_PROBES = 50_000  # pixels per object and view
COLUMNS = ("colorway", "object", "folder", "source", "wanted", "wanted_lab", "predicted", "predicted_ciede2000",
           "reached", "reached_ciede2000", "pixels", "views", "cannot_be_reached_because")  # fmt: skip
VIEW_COLUMNS = ("colorway", "object", "view", "wanted", "wanted_lab", "reached", "reached_ciede2000", "pixels",
                "cannot_be_reached_because")  # fmt: skip
THUMBNAIL = 192  # pixels, long side
LABEL, LINE, CHIP, GAP = 260, 18, 12, 6  # pixels: label width, line height, chip side, gaps
PAPER, INK = 255, (40, 40, 40)
Pixels = tuple[np.ndarray, np.ndarray]  # rows and columns, [n] each


# ------------------------------------------------------------------------------------------------------------- pictures
class PhotoPictures:
    """A captured view in its photo's own pixels, written in the photo's format."""

    def __init__(self, model: Model, view: View, size: str | int) -> None:
        self._view = model.photo_view(view, size)
        self.suffix, self.disputed = suffix_for(self._view.photo), self._view.disputed

    def recolored(self, edits: Sequence[Edit]) -> Iterator[Any]:
        """Yield a picture for each edit, for `write` and `colors`."""
        return self._view.recolor_all(edits)

    def write(self, path: Path, picture: Any) -> None:
        write_photo(path, picture)

    def colors(self, pixels: Pixels, picture: Any = None) -> np.ndarray:
        """Return sRGB colors [n, 3] of a picture, by default the unedited one, in the photos' mean exposure."""
        rows, columns = (numbers[:, None] for numbers in pixels)
        return to_mean_exposure((picture or self._view.photo).colors(rows, columns)[:, 0], self._view.gains)

    def covered(self, name: str) -> Pixels:
        """Return the pixels that are surely an object's."""
        matte = self._view.mattes[list(self._view.objects).index(name)]
        rows, columns = np.nonzero(matte.coverage > SURE)
        return rows + matte.rows[0], columns + matte.columns[0]


class FramePictures:
    """A rendered frame, written as 8-bit PNG; members as of `PhotoPictures`."""

    suffix = ".png"

    def __init__(self, model: Model, frame: Frame) -> None:
        self._model, self._frame, self.disputed = model, frame, frame.disputed

    def recolored(self, edits: Sequence[Edit]) -> Iterator[Any]:
        return (self._model.composite(self._frame, edit) for edit in edits)

    def write(self, path: Path, picture: Any) -> None:
        write_png(path, picture)

    def colors(self, pixels: Pixels, picture: Any = None) -> np.ndarray:
        return to_mean_exposure((self._frame.base if picture is None else picture)[pixels], self._frame.gains)

    def covered(self, name: str) -> Pixels:
        rows, columns = np.nonzero(self._frame.probabilities[self._model.objects.index(name)] > SURE)
        return rows, columns


Pictures = PhotoPictures | FramePictures


def pictures_of(model: Model, view: View, size: str | int, captured: bool) -> Pictures:
    """Prepare a captured view at a size (`photo`, `learned`, or pixels), or the view of any camera."""
    if not captured:
        return FramePictures(model, model.render(view.camera, model.settings.render.supersampling))
    if size == "learned":
        return FramePictures(model, model.preview(view, model.settings.geometry.long_side))
    return PhotoPictures(model, view, size)


class ColorProbe:
    """Color measurements in the pixels of a view that are surely an object's, near a source color."""

    def __init__(self, pictures: Pictures) -> None:
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


# --------------------------------------------------------------------------------------------------------------- tables
@dataclass(frozen=True)
class Reached:
    """A color, sRGB [3], as measured in this number of pixels and views."""

    color: np.ndarray
    pixels: int
    views: int


def write_table(
    path: Path,
    planned: Sequence[PlannedColorway],
    measured: Callable[[PlannedColorway, Prediction], Reached | None] | None = None,
    light: ReferenceLight | None = None,
) -> None:
    """Write the table of colorways, atomically. With a reference light all colors are those under it.

    measured: returns the measurement of a color; None before anything is rendered, to leave its columns empty.
    """
    rows = []
    for plan in planned:
        for prediction in plan.predictions:
            found = measured(plan, prediction) if measured else None
            row = _row(plan, prediction, found, light)
            if measured and found is None:
                nothing = f"none of these views surely shows a pixel of {prediction.target_color.name} in this color"
                row["cannot_be_reached_because"] = nothing
            rows.append(row)
    _write(path, COLUMNS, rows)


def write_view_table(
    path: Path,
    planned: Sequence[PlannedColorway],
    views: Sequence[str],
    measured: Callable[[PlannedColorway, Prediction, str], Reached | None],
    light: ReferenceLight | None = None,
) -> None:
    """Write the reached colors of each view, atomically; see `write_table`. measured: None where no pixel shows it."""
    rows = []
    for plan in planned:
        for prediction in plan.predictions:
            for view in views:
                found = measured(plan, prediction, view)
                if found is None:
                    reason = f"this view surely shows no pixel of {prediction.target_color.name} in this color"
                else:
                    reason = reason_in_view(prediction, found.color)
                row = {"view": view, "pixels": "0", **_row(plan, prediction, found, light)}
                rows.append(row | {"cannot_be_reached_because": reason})
    _write(path, VIEW_COLUMNS, rows)


def _row(
    plan: PlannedColorway, prediction: Prediction, found: Reached | None, light: ReferenceLight | None
) -> dict[str, str]:
    """Return the cells of a color by column."""
    lit = prediction.under_light(light)
    row = {
        "colorway": plan.colorway.name,
        "object": prediction.target_color.name,
        "folder": plan.colorway.folder,
        "source": rgb_to_hex(prediction.source),
        "wanted": rgb_to_hex(lit.target),
        "wanted_lab": " ".join(f"{value:.2f}" for value in lit.target_color.lab),
        "predicted": rgb_to_hex(lit.reached),
        "predicted_ciede2000": f"{lit.ciede2000:.2f}",
        "cannot_be_reached_because": prediction.reason,
    }
    if found is None:
        return row
    lit = replace(prediction, reached=found.color).under_light(light)
    difference = float(ciede2000(srgb_to_lab(lit.reached), lit.target_color.lab))
    row |= {"reached": rgb_to_hex(lit.reached), "reached_ciede2000": f"{difference:.2f}"}
    return row | {"pixels": str(found.pixels), "views": str(found.views)}


def _write(path: Path, columns: Sequence[str], rows: Sequence[dict[str, str]]) -> None:
    text = io.StringIO()
    table = csv.DictWriter(text, columns, restval="", extrasaction="ignore", lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    atomic_write(path, lambda temporary: temporary.write_text(text.getvalue(), encoding="utf-8"))


# -------------------------------------------------------------------------------------------------------- contact sheet
@dataclass(frozen=True)
class Line:
    """One line of a row's label: color chips (sRGB [3] each), and a text."""

    text: str
    chips: tuple[np.ndarray, ...] = ()


@dataclass(frozen=True)
class Row:
    """Lines of the label, and picture files of one color space; None leaves a place empty."""

    label: tuple[Line, ...]
    pictures: tuple[Path | None, ...]
    space: ColorSpace | None = None


def write_contact_sheet(path: Path, columns: Sequence[str], rows: Sequence[Row]) -> None:
    """Write the pictures of all rows below the columns' names; one picture is in memory at a time."""
    heights = [max(THUMBNAIL, LINE * len(row.label)) + GAP for row in rows]
    width = LABEL + len(columns) * (THUMBNAIL + GAP) + GAP
    sheet = np.full((LINE + 2 * GAP + sum(heights), width, 3), PAPER, np.uint8)
    top = LINE + 2 * GAP
    for row, height in zip(rows, heights, strict=True):
        for number, picture in enumerate(row.pictures):
            if picture is not None:
                small = _thumbnail(picture, row.space)
                left = LABEL + number * (THUMBNAIL + GAP)
                sheet[top : top + len(small), left : left + small.shape[1]] = small
        top += height
    drawing = Image.fromarray(sheet)
    _draw_names(ImageDraw.Draw(drawing), columns, rows, heights)
    write_png(path, np.asarray(drawing))


def _thumbnail(path: Path, space: ColorSpace | None) -> np.ndarray:
    """Read a picture as a thumbnail over white, uint8 [h, w, 3]."""
    picture = read_photo(path, space=space)
    if picture.shape[-1] == 4:
        picture = alpha_composite(picture[..., :3], picture[..., 3])
    factor = THUMBNAIL / max(picture.shape[:2])
    return to_bytes(resize(picture, *(max(1, round(side * factor)) for side in picture.shape[1::-1])))


def _draw_names(draw: ImageDraw.ImageDraw, columns: Sequence[str], rows: Sequence[Row], heights: Sequence[int]) -> None:
    font = ImageFont.load_default(LINE - GAP)
    for number, name in enumerate(columns):
        draw.text((LABEL + number * (THUMBNAIL + GAP), GAP), _fitting(name, THUMBNAIL, font), INK, font)
    top = LINE + 2 * GAP
    for row, height in zip(rows, heights, strict=True):
        for number, line in enumerate(row.label):
            left, y = GAP, top + number * LINE
            for chip in line.chips:
                draw.rectangle((left, y, left + CHIP, y + CHIP), tuple(to_bytes(chip).tolist()), INK)
                left += CHIP + GAP
            draw.text((left, y - 1), _fitting(line.text, LABEL - left - GAP, font), INK, font)
        top += height


def _fitting(text: str, width: int, font: ImageFont.ImageFont | ImageFont.FreeTypeFont) -> str:
    """Cut a text to a width in pixels."""
    while len(text) > 1 and font.getlength(text) > width:
        text = text[:-2].rstrip() + "…"
    return text
