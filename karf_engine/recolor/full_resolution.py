"""Recoloring a photo in its own pixels, at its file's size and bit depth.

As in `palettes.compositing`, the result is linear in the edit: photo + sum over objects and palette entries of
coverage x weight(own color) x gains x (edited - learned). Palettes are of the mean exposure of all photos, gains are the
photo's (`palettes.calibration`). The own color is the object's unmixed and denoised color in the pixel: weights of noisy
colors would amplify the noise, weights of the denoised photo leave it as it is. Bands of rows bound the memory.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby

import cv2
import numpy as np

from ..capture.capture import UNIT_GAINS, View
from ..capture.training_images import photo_path
from ..errors import BadRequest
from ..io.arguments import check_arguments, check_array, check_fields, check_number
from ..io.color import to_bytes
from ..io.images import INVERSE_EXIF_ORIENTATION, alpha_composite, apply_exif_orientation, apply_exif_orientation_copy
from ..palettes.added import append_added_sets, extended_palettes, split_weights
from ..palettes.calibration import to_photo_exposure
from ..palettes.compositing import hard_masks
from ..palettes.edge_shape import EdgeShape, active_edges
from ..palettes.palette import AddedColor, Edit, Palette, check_edit
from ..palettes.palette_weights import palette_weights_of_image, star_weights
from .frames import Frame, Layers, one_line
from .matting.matte import NEGLIGIBLE, Matte, disputed_objects, shape_mattes
from .matting.thin_parts import Marks
from .photos import StoredPhoto, from_camera, open_photo

BAND_PIXELS = 1 << 19
MIN_SCALE = 1e-6
# from photo, probabilities, rendered picture, marks
FindMattes = Callable[[np.ndarray, np.ndarray, np.ndarray, Marks], list[Matte]]
RADIUS = 3  # pixels, of the bilateral filter
SIGMA_COLOR = 4.0  # of the bilateral filter, standard deviations of the noise
MIN_GRAIN = 0.3  # 1/255: the rounding of 8 bits
COPIES_BYTES = 400 << 20  # of photos edited at once, which share a band's weights


@dataclass(frozen=True)
class PhotoView:
    """A captured photo that is ready to be recolored, any number of times."""

    photo: StoredPhoto  # in its stored grid, at the size of the result
    orientation: int  # Exif orientation between the stored grid and the camera's
    objects: Sequence[str]
    mattes: Sequence[Matte]  # of the K objects, in the stored grid
    palettes: Sequence[Palette]  # as learned; empty before palettes are learned
    scale: float = 1.0  # size of the result relative to the photo's full size
    grain: float = 0.0  # `estimate_noise` of the photo; 0: without denoising
    gains: tuple[float, float, float] = field(default=UNIT_GAINS, kw_only=True)  # exposure of the photo, see `View`

    def __post_init__(self) -> None:
        check_fields(self)
        check_number("orientation", self.orientation, 1, 8)
        check_number("scale", self.scale, MIN_SCALE)
        check_number("grain", self.grain, 0)

    def __repr__(self) -> str:
        width, height = self.photo.size
        return one_line("PhotoView", f"{width}x{height}: {', '.join(self.objects)}")

    @check_arguments
    def recolor(self, edit: Edit) -> StoredPhoto:
        """Recolor the photo. Raises BadRequest before palettes are learned."""
        return next(self.recolor_all([edit]))

    @check_arguments
    def recolor_all(self, edits: Sequence[Edit]) -> Iterator[StoredPhoto]:
        """Recolor the photo with each edit, a few at a time. Raises BadRequest before palettes are learned."""
        if not self.palettes:
            raise BadRequest("There is no finished recoloring stage.", "Run the recoloring stage first.")
        for edit in edits:
            check_edit(edit, self.palettes)
        for edges, same in groupby(edits, lambda edit: active_edges(edit.edges)):
            yield from self._with_edges(edges)._recolored_by(list(same))

    def _recolored_by(self, edits: Sequence[Edit]) -> Iterator[StoredPhoto]:
        at_once = max(1, COPIES_BYTES // self.photo.pixels.nbytes)
        for first in range(0, len(edits), at_once):
            batch = edits[first : first + at_once]
            copies = [self.photo.copy() for _ in batch]
            for rows, columns in self._bands():
                for copy, change in zip(copies, self._changes(rows, columns, batch), strict=True):
                    copy.change(rows, columns, change)
            yield from copies

    def _with_edges(self, edges: Mapping[str, EdgeShape]) -> PhotoView:
        if not active_edges(edges):
            return self
        mattes = shape_mattes(self.mattes, self.objects, edges, self.photo.over_white(), self.scale)
        return replace(self, mattes=mattes)

    @property
    def disputed(self) -> tuple[str, ...]:
        """Objects about which photo and field disagree; their edges are the field's."""
        return disputed_objects(self.objects, self.mattes)

    def masks(self) -> np.ndarray:
        """Return the mask of each object where it is the most probable class, [K, H, W] bool in the stored grid."""
        width, height = self.photo.size
        result = np.zeros((len(self.mattes), height, width), bool)
        for rows, columns in self._bands():
            result[:, rows, columns] = hard_masks(self._coverages(rows, columns))
        return result

    @check_arguments
    def over_white(self, photo: StoredPhoto) -> np.ndarray:
        """Return an edited copy in the camera's grid, over white: float32 sRGB [H, W, 3]."""
        return apply_exif_orientation_copy(alpha_composite(photo.colors(), photo.alpha()), self.orientation)

    @check_arguments
    def layers(
        self,
        depth: np.ndarray,
        added: Mapping[str, Sequence[AddedColor]] | None = None,
        edges: Mapping[str, EdgeShape] | None = None,
    ) -> Layers:
        """Return the photo's layers in the camera's grid, over white.

        depth: [h, w] along the optical axis in the camera's grid, of any size. Each pixel takes the nearest one.
        """
        if edges and active_edges(edges):
            return self._with_edges(edges).layers(depth, added)
        check_array("depth", depth, ("h", "w"))
        check_number("depth.size", depth.size, 1)
        if self.photo.pixels.dtype == np.uint8:
            base = apply_exif_orientation(self.photo.over_white(), self.orientation)
        else:
            base = self.over_white(self.photo)
        height, width = base.shape[:2]
        added = added or {}
        palettes = extended_palettes(self.palettes, added)
        coverage = np.zeros((len(palettes), height, width), np.float16)
        n_colors = max(len(palette.colors) for palette in palettes)
        weights = np.zeros((len(palettes), n_colors, height, width), np.float16)
        for rows, columns in self._bands():
            coverages, alpha = self._coverages(rows, columns), self.photo.alpha(rows, columns)
            coverages = coverages if alpha is None else np.minimum(coverages, alpha)
            for k, covered, shares in self._shares(rows, columns, coverages):
                inside = covered > 0
                self._as_stored(coverage[k])[rows, columns] = covered
                own = self.palettes[k]
                planes = split_weights(shares.T, own.colors, added.get(own.name, ()))
                for plane, share in zip(weights[k], planes, strict=False):  # small palettes are padded
                    self._as_stored(plane)[rows, columns][inside] = covered[inside] * share
        nearest = (
            ((np.arange(many) + 0.5) * few / many).astype(np.intp)
            for few, many in zip(depth.shape, (height, width), strict=True)
        )
        return Layers(palettes, base, coverage, weights, depth[np.ix_(*nearest)], self.gains)

    def _as_stored(self, plane: np.ndarray) -> np.ndarray:
        return apply_exif_orientation(plane, INVERSE_EXIF_ORIENTATION.get(self.orientation, self.orientation))

    def _bands(self) -> Iterator[tuple[slice, slice]]:
        """Yield rows and columns of bands of the bounding box of all objects."""
        seen = [matte for matte in self.mattes if matte.coverage.size]
        if not seen:
            return
        columns = slice(min(matte.columns[0] for matte in seen), max(matte.columns[1] for matte in seen))
        last = max(matte.rows[1] for matte in seen)
        step = max(1, BAND_PIXELS // (columns.stop - columns.start))
        for top in range(min(matte.rows[0] for matte in seen), last, step):
            yield slice(top, min(top + step, last)), columns

    def _coverages(self, rows: slice, columns: slice) -> np.ndarray:
        return np.stack([matte.coverage_in(rows, columns) for matte in self.mattes])

    def _changes(self, rows: slice, columns: slice, edits: Sequence[Edit]) -> list[np.ndarray]:
        """Return the change of a band's straight colors by each edit, [h, w, 3] float32."""
        coverages = self._coverages(rows, columns)
        winners = hard_masks(coverages)
        alpha = self.photo.alpha(rows, columns)
        if alpha is not None:  # coverage is relative to the whole pixel, colors are straight
            coverages = np.divide(coverages, alpha, out=np.zeros_like(coverages), where=alpha > 0).clip(0, 1)
        changes = [np.zeros((*coverages.shape[1:], 3), np.float32) for _ in edits]
        for k, coverage, weights in self._shares(rows, columns, coverages):
            palette, wins, inside = self.palettes[k], winners[k], coverage > 0
            for edit, change in zip(edits, changes, strict=True):
                edited, added = edit.colors[palette.name], edit.added.get(palette.name, ())
                learned = append_added_sets(palette.colors, added)
                shares = split_weights(weights.T, palette.colors, added).T
                if edit.compositing == "paper":
                    inner, own = wins[inside], to_photo_exposure(edited, self.gains)
                    change[wins & inside] = (shares[inner] @ own) - self.photo.colors(rows, columns)[wins & inside]
                elif (edited != learned).any():
                    own = to_photo_exposure(edited - learned, self.gains)
                    change[inside] += coverage[inside][:, None] * (shares @ own)
        return changes

    def _shares(
        self, rows: slice, columns: slice, coverages: np.ndarray
    ) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
        """Yield number, coverage [h, w] and palette weights [n, M] of the n covered pixels of each object."""
        for k, (palette, matte, coverage) in enumerate(zip(self.palettes, self.mattes, coverages, strict=True)):
            inside = coverage > 0
            if inside.any():
                yield k, coverage, _weights(self._own_colors(matte, rows, columns, inside), palette, self.gains)

    def _own_colors(self, matte: Matte, rows: slice, columns: slice, inside: np.ndarray) -> np.ndarray:
        """Return an object's own colors in the n pixels that it covers: uint8 [n, 3], or float for deep photos."""
        top, bottom = max(rows.start, matte.rows[0]), min(rows.stop, matte.rows[1])
        denoised = self._denoised(slice(top, bottom), slice(*matte.columns))
        own = matte.colors(denoised, top - matte.rows[0], bottom - matte.rows[0])
        left, right = (side - columns.start for side in matte.columns)
        own = own[inside[top - rows.start : bottom - rows.start, left:right]]
        return own if own.dtype == np.uint8 else own / 255

    def _denoised(self, rows: slice, columns: slice) -> np.ndarray:
        """Return denoised pixels: uint8 [h, w, 3], or float32 from 0 to 255 for deep photos."""
        height, width = self.photo.pixels.shape[:2]
        outer = tuple(
            slice(max(0, each.start - RADIUS), min(side, each.stop + RADIUS))
            for each, side in ((rows, height), (columns, width))
        )
        is_deep = self.photo.pixels.dtype != np.uint8
        seen = self.photo.colors(*outer) * np.float32(255) if is_deep else self.photo.pixels[*outer, :3]
        inner = tuple(
            slice(each.start - wide.start, each.stop - wide.start)
            for each, wide in zip((rows, columns), outer, strict=True)
        )
        return np.ascontiguousarray(denoise(seen, self.grain)[inner])


def make_photo_view(
    view: View,
    size: str | int,  # `photo`, or the long side in pixels of the reduced photo
    seen: Frame,  # the field's rendering with the camera's lens distortion, at any size
    marks: Marks,
    mattes_of: FindMattes,
    objects: Sequence[str],
    palettes: Sequence[Palette],
) -> PhotoView:
    """Prepare a captured view for recoloring in its photo's own pixels; see `Model.photo_view`."""
    photo = open_photo(photo_path(view), view.space)
    orientation, full_size = photo.orientation_for(view.camera), max(photo.size)
    if size != "photo":
        photo = photo.resized(int(size))
    rendered = from_camera(to_bytes(seen.color * np.array(view.gains, np.float32)), orientation)
    seen_objects = [from_camera(own, orientation) for own in seen.probabilities]
    probabilities = np.array(seen_objects).reshape(-1, *rendered.shape[:2])
    shown, scale = photo.over_white(), max(photo.size) / full_size
    if marks.drawn is not None:
        marks = replace(marks, drawn=np.stack([from_camera(own, orientation) for own in marks.drawn]))
    mattes = mattes_of(shown, probabilities, rendered, marks)
    return PhotoView(photo, orientation, objects, mattes, palettes, scale, estimate_noise(shown), gains=view.gains)


def _weights(colors: np.ndarray, palette: Palette, gains: Sequence[float]) -> np.ndarray:
    """Return palette weights [n, M] of a photo's colors [n, 3]; 8-bit colors are computed once each."""
    own = to_photo_exposure(palette.colors, gains)
    if colors.dtype == np.uint8:
        return palette_weights_of_image(colors[None], own)[0]
    return star_weights(colors, own)


def dense_weights(
    own_colors: Sequence[np.ndarray],
    palettes: Sequence[Palette],
    coverages: np.ndarray,
    gains: Sequence[float] = UNIT_GAINS,
) -> np.ndarray:
    """Return palette weights times coverages [K, H, W], [K, M, H, W] float32; M is that of the largest palette.

    own_colors: of each object, uint8 sRGB [H, W, 3]. gains: exposure of the photo, see `View`.
    """
    n_colors = max((len(palette.colors) for palette in palettes), default=0)
    result = np.zeros((len(coverages), n_colors, *coverages.shape[1:]), np.float32)
    for planes, own, palette, coverage in zip(result, own_colors, palettes, coverages, strict=True):
        inside = coverage > NEGLIGIBLE
        planes[: len(palette.colors), inside] = (_weights(own[inside], palette, gains) * coverage[inside][:, None]).T
    return result


def estimate_noise(photo: np.ndarray) -> float:
    """Estimate the standard deviation per channel of the noise of a photo [H, W, 3], uint8 or float from 0 to 255.

    Robust median estimator on the diagonal details of the Haar wavelet (Donoho and Johnstone 1994, "Ideal spatial
    adaptation by wavelet shrinkage").
    """
    height, width = (side // 2 * 2 for side in photo.shape[:2])
    if not height or not width:
        return 0.0
    blocks = photo[:height, :width].astype(np.float32).reshape(height // 2, 2, width // 2, 2, 3)
    details = (blocks[:, 0, :, 0] - blocks[:, 0, :, 1] - blocks[:, 1, :, 0] + blocks[:, 1, :, 1]) / 2
    return float(np.median(np.abs(details), axis=(0, 1)).mean() / 0.6745)


def denoise(photo: np.ndarray, grain: float) -> np.ndarray:
    """Denoise a photo [H, W, 3], uint8 or float32 from 0 to 255, by a bilateral filter (Tomasi and Manduchi 1998).

    grain: its `estimate_noise`; below the rounding of 8 bits the photo itself is returned.
    """
    if grain < MIN_GRAIN:
        return photo
    return cv2.bilateralFilter(np.ascontiguousarray(photo), 2 * RADIUS + 1, SIGMA_COLOR * grain, RADIUS)
