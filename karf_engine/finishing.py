"""Recoloring in a photo's own pixels: its objects' mattes and its own colors, at the photo's size and depth.

The picture is linear in the edit, as in `edit.compositing`: photo + sum over objects and palette entries of
coverage x weight(own color) x (edited - learned). Where a pixel is a mixture, the own color is that of the object in it.
Pixels are done in bands of rows, so that memory grows with what the files hold and not with what is computed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from .edit.palette import Edit, Palette
from .errors import BadRequest
from .images import oriented
from .matting.matte import Matte
from .palette.star_weights import palette_weights_of_image, star_weights
from .photos import StoredPhoto

BAND_PIXELS = 1 << 19
COPIES_BYTES = 400 << 20  # of edited photos at once: the weights of a band serve them all


@dataclass(frozen=True)
class PhotoView:
    """A captured photo that is ready to be recolored, any number of times.

    Attributes:
        photo: The photo in its stored grid, at the size of the result.
        orientation: Exif orientation between the stored grid and the camera's.
        objects: Names of the K objects.
        mattes: What each object covers, in the stored grid.
        palettes: Of the objects, as learned; empty before palettes are learned.
    """

    photo: StoredPhoto
    orientation: int
    objects: Sequence[str]
    mattes: Sequence[Matte]
    palettes: Sequence[Palette]

    def recolored(self, edit: Edit) -> StoredPhoto:
        """The photo with an edit. Raises BadRequest before palettes are learned."""
        return next(self.recolored_by([edit]))

    def recolored_by(self, edits: Sequence[Edit]) -> Iterator[StoredPhoto]:
        """The photo with each of some edits, a few at a time. Raises BadRequest before palettes are learned."""
        if not self.palettes:
            raise BadRequest("There is no finished recoloring stage.", "Run the recoloring stage first.")
        at_once = max(1, COPIES_BYTES // self.photo.pixels.nbytes)
        for first in range(0, len(edits), at_once):
            some = edits[first : first + at_once]
            copies = [self.photo.copy() for _ in some]
            for rows, columns in self._bands(self.mattes):
                for copy, change in zip(copies, self._changes(rows, columns, some), strict=True):
                    copy.change(rows, columns, change)
            yield from copies

    def masks(self) -> np.ndarray:
        """The likeliest class of each pixel as masks in the stored grid, [K, H, W] bool."""
        width, height = self.photo.size
        result = np.zeros((len(self.mattes), height, width), bool)
        for rows, columns in self._bands(self.mattes):
            result[:, rows, columns] = self._winners(rows, columns)
        return result

    def shown(self, photo: StoredPhoto) -> np.ndarray:
        """An edited copy as its camera sees it, on white where it is transparent: float32 sRGB [H, W, 3]."""
        colors, alpha = photo.colors(), photo.alpha()
        if alpha is not None:
            colors = colors * alpha[..., None] + (1 - alpha[..., None])
        return oriented(colors, self.orientation)

    def _bands(self, mattes: Sequence[Matte]) -> Iterator[tuple[slice, slice]]:
        """Bands of rows of the box round all objects."""
        seen = [matte for matte in mattes if matte.coverage.size]
        if not seen:
            return
        columns = slice(min(matte.columns[0] for matte in seen), max(matte.columns[1] for matte in seen))
        last = max(matte.rows[1] for matte in seen)
        step = max(1, BAND_PIXELS // (columns.stop - columns.start))
        for top in range(min(matte.rows[0] for matte in seen), last, step):
            yield slice(top, min(top + step, last)), columns

    def _coverages(self, rows: slice, columns: slice) -> np.ndarray:
        """[K, h, w] float32."""
        result = np.zeros((len(self.mattes), rows.stop - rows.start, columns.stop - columns.start), np.float32)
        for matte, coverage in zip(self.mattes, result, strict=True):
            top, bottom = max(rows.start, matte.rows[0]), min(rows.stop, matte.rows[1])
            if top < bottom:
                left, right = (side - columns.start for side in matte.columns)
                own = matte.coverage[top - matte.rows[0] : bottom - matte.rows[0]]
                coverage[top - rows.start : bottom - rows.start, left:right] = own
        return result

    def _winners(self, rows: slice, columns: slice) -> np.ndarray:
        coverages = self._coverages(rows, columns)
        background = 1 - coverages.sum(0)
        return (coverages > background) & (coverages == coverages.max(0, initial=0))

    def _changes(self, rows: slice, columns: slice, edits: Sequence[Edit]) -> list[np.ndarray]:
        """Change of the straight colors of a band by each edit, [h, w, 3] float32."""
        coverages, winners = self._coverages(rows, columns), self._winners(rows, columns)
        alpha = self.photo.alpha(rows, columns)
        if alpha is not None:  # a matte's coverage counts what is seen through the pixel, colors are straight
            coverages = np.divide(coverages, alpha, out=np.zeros_like(coverages), where=alpha > 0).clip(0, 1)
        changes = [np.zeros((*coverages.shape[1:], 3), np.float32) for _ in edits]
        for palette, matte, coverage, wins in zip(self.palettes, self.mattes, coverages, winners, strict=True):
            inside = coverage > 0
            if not inside.any():
                continue
            weights = _weights(self._own_colors(matte, rows, columns, inside), palette)
            for edit, change in zip(edits, changes, strict=True):
                edited = edit.colors[palette.name]
                if edit.compositing == "paper":
                    inner = wins[inside]
                    change[wins & inside] = (weights[inner] @ edited) - self.photo.colors(rows, columns)[wins & inside]
                elif (edited != palette.colors).any():
                    change[inside] += coverage[inside][:, None] * (weights @ (edited - palette.colors))
        return changes

    def _own_colors(self, matte: Matte, rows: slice, columns: slice, inside: np.ndarray) -> np.ndarray:
        """Own colors of an object in the pixels of a band that it covers: uint8 [n, 3], of deep photos float in [0, 1]."""
        top, bottom = max(rows.start, matte.rows[0]), min(rows.stop, matte.rows[1])
        place = slice(top, bottom), slice(*matte.columns)
        is_deep = self.photo.pixels.dtype != np.uint8
        seen = self.photo.colors(*place) * 255 if is_deep else self.photo.pixels[*place, :3]
        own = matte.colors(np.ascontiguousarray(seen), top - matte.rows[0], bottom - matte.rows[0])
        left, right = (side - columns.start for side in matte.columns)
        own = own[inside[top - rows.start : bottom - rows.start, left:right]]
        return own if own.dtype == np.uint8 else own / 255


def _weights(colors: np.ndarray, palette: Palette) -> np.ndarray:
    """Palette weights [n, M] of colors [n, 3]; of 8-bit colors once for each."""
    if colors.dtype == np.uint8:
        return palette_weights_of_image(colors[None], palette.colors)[0]
    return star_weights(colors, palette.colors)
