"""Details of the marked objects: more Gaussians, learned from crops of the photos near their own size.

It starts from a draft of the whole scene. What lies outside the objects' boxes stays as it is, but for its constant
color. The Gaussians added are parts of the draft's, most where the draft differs most from the photos; those that become
transparent are moved to where the error is largest (as in Kheradmand et al. 2024, "3D Gaussian Splatting as Markov Chain
Monte Carlo").
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter
from scipy.spatial.transform import Rotation

from ..capture.camera import Camera
from ..capture.capture import View
from .fit import WINDOW, Photo, SplatFit, load_photos
from .gaussians import Gaussians
from .kernels.arrays import CENTER, LOG_SCALE, LOGIT, ROTATION
from .rasterizer import Device, rasterize

MARGIN = 0.08  # of a crop around an object, in its longer sides
LEAST_SIDE = 8  # of a crop, pixels; photos that show less of an object are left out
QUANTILE = 0.002  # share of an object's Gaussians beyond each side of its crop
OPAQUE = 0.0  # logit of Gaussians that outline an object
TRANSPARENT = -4.0  # logit below which a Gaussian is moved
MOVED_AT = (0.15, 0.3, 0.45, 0.6)  # fractions of the iterations
MEASURED = 24  # crops that measure where the error is
BLUR = 3  # pixels, side of the square in which errors are averaged
RATE = 0.5  # of the learning rates of a draft


@dataclass(frozen=True)
class Quality:
    """How finely the objects are learned."""

    long_side: int  # photos are reduced to this long side, pixels
    count: int  # Gaussians added
    pixels: float  # of crops shown in all


QUALITIES = {"good": Quality(1600, 60_000, 1.2e8), "best": Quality(4096, 300_000, 8e8)}


class DetailFit(SplatFit):
    """Fit of a draft whose first `n_fine` Gaussians learn everything, and the others their constant color."""

    def __init__(
        self,
        start: Gaussians,
        n_fine: int,
        crops: Sequence[Photo],
        iterations: int,
        seed: int,
        device: Device = "cpu",
    ) -> None:
        coarse = replace(start, n_background=len(start) - n_fine, visibility=None)
        super().__init__(coarse, crops, iterations, seed, device=device, halved=0.0)
        self._n_fine = n_fine
        self._moved_at = {round(fraction * iterations) for fraction in MOVED_AT} - {0}
        self._rates *= np.float32(RATE)

    def _step(self) -> float:
        if self.done in self._moved_at:
            self._move()
        return super()._step()

    def _move(self) -> None:
        """Move transparent Gaussians to where the error is largest."""
        random = np.random.default_rng([self._seed, self.done, 3])
        fine = self.gaussians.table[: self._n_fine]
        free = np.flatnonzero(fine[:, LOGIT] < TRANSPARENT)
        numbers = random.choice(len(self._photos), min(MEASURED, len(self._photos)), replace=False)
        crops = [(self._photos[number], self.gains[number]) for number in numbers]
        errors = errors_of(self.gaussians, crops)[: self._n_fine]
        errors[free] = 0
        parents, parts = _parts(fine, errors, len(free), random)
        rows = np.concatenate([parents, free[: len(parts) - len(parents)]])
        self._table.replace_rows(rows, parts[: len(rows)])


def refined(
    draft: Gaussians, is_inside: np.ndarray, crops: Sequence[Photo], count: int, seed: int
) -> tuple[Gaussians, int]:
    """Return a draft with `count` more Gaussians, and the number of those in the objects' boxes, its first rows.

    is_inside: [n] bool, which of the draft's Gaussians are in a box.
    """
    random = np.random.default_rng([seed, 4])
    errors = errors_of(draft, [(crop, 1.0) for crop in crops])
    fine = draft.table[is_inside]
    parents, parts = _parts(fine, errors[is_inside], count, random)
    fine[parents] = parts[: len(parents)]
    table = np.concatenate([fine, parts[len(parents) :], draft.table[~is_inside]])
    return replace(draft, table=table, visibility=None), len(table) - int((~is_inside).sum())


def _parts(
    table: np.ndarray, errors: np.ndarray, count: int, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Divide Gaussians so that there are `count` more, the most where the errors [n] are large.

    Returns the divided rows [m] and their parts [m + count, P], first one of each row.
    """
    if count == 0 or not errors.any():
        return np.zeros(0, int), np.zeros((0, table.shape[1]), table.dtype)
    more = random.multinomial(count, errors / errors.sum())
    parents = np.flatnonzero(more)
    rows = np.concatenate([parents, np.repeat(parents, more[parents])])
    parts, shares = table[rows], 1.0 / (1 + more[rows])
    scales = np.exp(parts[:, LOG_SCALE : LOG_SCALE + 3])
    rotations = Rotation.from_quat(parts[:, [ROTATION + 1, ROTATION + 2, ROTATION + 3, ROTATION]])
    offsets = scales * random.standard_normal((len(rows), 3)) * np.sqrt(1 - shares)[:, None]
    parts[:, CENTER : CENTER + 3] += rotations.apply(offsets).astype(np.float32)
    widest = np.argsort(scales, 1)[:, 1:]  # a disk stays as thick as it is
    shrunk = np.log(shares)[:, None].astype(np.float32) / 2
    logs = np.take_along_axis(parts[:, LOG_SCALE : LOG_SCALE + 3], widest, 1) + shrunk
    np.put_along_axis(parts[:, LOG_SCALE : LOG_SCALE + 3], widest, logs, 1)
    return parents, parts


def errors_of(gaussians: Gaussians, crops: Sequence[tuple[Photo, np.ndarray | float]]) -> np.ndarray:
    """Return the squared error at each Gaussian times the pixels that it covers, summed over crops, [n] float64.

    crops: with their exposure gains, [3] sRGB or 1.
    """
    total = np.zeros(len(gaussians))
    for crop, gains in crops:
        view = rasterize(gaussians, crop.camera)
        squares = np.square(np.float32(gains) * view.image[..., :3] - crop.over(gaussians.background)).sum(2)
        squares = uniform_filter(squares if crop.valid is None else squares * crop.valid, BLUR)
        seen = np.flatnonzero(view.is_seen)
        pixels = crop.camera.project(gaussians.table[seen, :3].astype(np.float64))[0]
        column, row = pixels.clip(0, np.array([crop.camera.width, crop.camera.height]) - 1).astype(int).T
        total[seen] += view.weights()[seen] * squares[row, column]
    return total


def iterations_of(crops: Sequence[Photo], quality: Quality) -> int:
    """Return how many windows of crops have about the pixels that a quality shows."""
    pixels = [np.prod(np.minimum(crop.color.shape[:2], WINDOW)) for crop in crops]
    return max(1, round(quality.pixels / float(np.mean(pixels))))


def load_crops(views: Sequence[View], long_side: int, objects: Sequence[np.ndarray]) -> list[Photo]:
    """Load crops of photos around objects, [n, 3] points of each in the world, one photo at a time."""
    crops = []
    for view in views:
        photo = load_photos([view], long_side)[0]
        for points in objects:
            place = place_of(points, photo.camera)
            if place is not None:
                crops.append(photo.cropped(*place))
    return crops


def place_of(points: np.ndarray, camera: Camera) -> tuple[slice, slice] | None:
    """Return the rows and columns of a pinhole's picture around points [n, 3]; None if it shows hardly any."""
    pixels, depth = camera.project(points)
    pixels = pixels[depth > 0]
    if len(pixels) < len(points) / 2 or not len(points):
        return None
    least, most = np.quantile(pixels, (QUANTILE, 1 - QUANTILE), axis=0)
    margin = MARGIN * (most - least).max() + 1
    size = np.array([camera.width, camera.height])
    (left, top), (right, bottom) = np.clip([least - margin, most + margin], 0, size).round().astype(int)
    if min(right - left, bottom - top) < LEAST_SIDE:
        return None
    return slice(top, bottom), slice(left, right)
