"""Contact sheets: thumbnails in labeled rows, as one PNG."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ..io.color import to_bytes
from ..io.color_spaces import ColorSpace
from ..io.images import alpha_composite, read_photo, resize, write_png

THUMBNAIL = 192  # pixels, long side
LABEL, LINE, CHIP, GAP = 260, 18, 12, 6  # pixels: label width, line height, chip side, gaps
PAPER, INK = 255, (40, 40, 40)


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
    """Write the pictures of all rows below the columns' names; one picture is in memory at a time.

    Raises:
        DataError: A picture is damaged.
    """
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
