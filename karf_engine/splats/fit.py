"""Refining Gaussians on the photos: Adam on the rows that a photo shows, mean squared error, each photo as exposed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace

import numpy as np
import torch
from torch import Tensor

from ..capture.camera import Camera
from ..capture.training_images import TrainingImage
from ..compute.cores import share
from ..compute.progress import Progress
from ..errors import Diverged
from ..fields.training.checkpoint import Checkpoint
from ..fields.training.state import check_alike, number, whole_number
from ..io.color import to_bytes
from ..io.images import resize
from .exposures import Exposures
from .gaussians import Gaussians
from .kernels.adam import adam
from .kernels.arrays import CENTER, COLOR, LOG_SCALE, LOGIT, ROTATION
from .rasterizer import SplattedView, pinhole

WINDOW = 400  # pixels: of larger photos a window of at most this side and height is learned from at a time
HALVED = 0.6  # share of the iterations, at first, that show photos at half their size
PHOTO_EVERY = 3  # iterations, where there are pictures between the photos: the others show these
LAST_RATE = 0.05  # all rates fall to this share
LEAST_PIXELS = 0.1  # scale of a Gaussian where a photo shows it largest, pixels: nothing is finer than photos show


@dataclass(frozen=True)
class Rates:
    """Learning rates, of the centers in sizes of the Gaussian.

    Four (colors, opacity) to sixteen times those of Kerbl et al. 2023: there are hundreds of steps here, not tens of
    thousands. Chosen on the demo capture, 15 to 30 seconds of learning.
    """

    center: float = 0.2
    scale: float = 0.16
    rotation: float = 0.03
    opacity: float = 0.1
    color: float = 0.02
    harmonics: float = 0.008


@dataclass(frozen=True)
class Photo:
    """A photo to learn from.

    Attributes:
        camera: A pinhole of its size.
        color: uint8 sRGB [H, W, 3], straight.
        alpha: float32 [H, W]; None where the photo is opaque.
        valid: bool [H, W], False where nothing is known; None where all is.
    """

    camera: Camera
    color: np.ndarray
    alpha: np.ndarray | None
    valid: np.ndarray | None

    @classmethod
    def of(cls, image: TrainingImage) -> Photo:
        """A training image, in a quarter of its memory."""
        return cls(image.camera, to_bytes(image.color), image.alpha, image.valid)

    def over(self, background: Sequence[float]) -> np.ndarray:
        """The photo over an sRGB color, [H, W, 3] float32."""
        color = np.float32(self.color) / 255
        if self.alpha is None:
            return color
        return self.alpha[..., None] * color + (1 - self.alpha[..., None]) * np.float32(background)

    def halved(self) -> Photo:
        """The photo at half its size."""
        height, width = (max(1, side // 2) for side in self.color.shape[:2])
        color = to_bytes(resize(np.float32(self.color) / 255, width, height))
        alpha = None if self.alpha is None else resize(self.alpha, width, height)
        valid = None if self.valid is None else resize(np.float32(self.valid), width, height) > 0.999
        return Photo(self.camera.scaled(width, height), color, alpha, valid)

    def window(self, left: int, top: int) -> Photo:
        """At most WINDOW x WINDOW pixels from this corner."""
        camera, rows, columns = self.camera, slice(top, top + WINDOW), slice(left, left + WINDOW)
        height, width = self.color[rows, columns].shape[:2]
        alpha, valid = (None if each is None else each[rows, columns] for each in (self.alpha, self.valid))
        moved = replace(camera, width=width, height=height, cx=camera.cx - left, cy=camera.cy - top)
        return Photo(moved, self.color[rows, columns], alpha, valid)


class SplatFit:
    """Gaussians as they are learned.

    Attributes:
        iterations: Of the whole.
        done: Of those, so far.
    """

    def __init__(
        self,
        gaussians: Gaussians,
        photos: Sequence[Photo],
        iterations: int,
        seed: int,
        rates: Rates = Rates(),
        between: Sequence[Photo] = (),
    ) -> None:
        """A fresh fit.

        Args:
            gaussians: To begin with; they are not changed.
            photos: To learn from.
            iterations: Photos to show, or windows of them.
            seed: Of their order.
            rates: How fast.
            between: Pictures of the field, of cameras between the photos; where there are any, two of three iterations
                show one.
        """
        self.iterations, self.done = iterations, 0
        self._start, self._photos, self._seed = gaussians, photos, seed
        self._exposures = Exposures(len(photos))
        self._halves = [photo.halved() for photo in photos]
        self._between = between, [picture.halved() for picture in between]
        self._table = gaussians.table.copy()
        self._gradients, self._means, self._squares = (np.zeros_like(self._table) for _ in range(3))
        self._steps = np.zeros(len(gaussians), np.int32)
        self._sizes = np.exp(self._table[:, LOG_SCALE : LOG_SCALE + 3].max(1))
        self._least = np.log(LEAST_PIXELS * _pixel_sizes(gaussians, photos)).astype(np.float32)
        self._rates = _by_column(rates, self._table.shape[1])

    @property
    def gaussians(self) -> Gaussians:
        """What is learned so far."""
        return replace(self._start, table=self._table.copy())

    @property
    def gains(self) -> np.ndarray:
        """How each photo is exposed beside the others, [n, 3] float32: gains of red, green and blue."""
        return self._exposures.gains

    def run(self, progress: Progress, checkpoint: Checkpoint | None = None) -> None:
        """Learn until all iterations are done.

        Raises:
            Diverged: The error is not finite.
            Cancelled: `progress` was asked to stop.
        """
        while self.done < self.iterations:
            error = self._step()
            if not (np.isfinite(error) and self._is_finite()):
                raise Diverged(
                    "Training diverged at iteration {iteration}: loss {loss}.",
                    "Lower the learning rate.",
                    iteration=self.done,
                    loss=float(error),
                )
            self.done += 1
            progress.step(psnr=-10 * np.log10(error + 1e-10))
            if checkpoint is not None:
                checkpoint.offer()

    def _step(self) -> float:
        """Learn from one photo; its mean squared error."""
        random = np.random.default_rng([self._seed, self.done])
        photo, number = self._photo(random)
        # what is behind a matte changes each time: only what is solid can hide it
        background = self._start.background if photo.alpha is None else tuple(random.random(3))
        camera = pinhole(photo.camera, self._start.near, self._start.screen_filter)
        view = SplattedView(self._table, camera, background)
        shown, wanted = view.image[..., :3], photo.over(background)
        gains = 1 if number is None else self._gains(number, photo, shown, wanted)
        difference = gains * shown - wanted
        if photo.valid is not None:
            difference *= photo.valid[..., None]
        view.backward(gains * difference * np.float32(2 / difference.size), self._gradients)
        self._hold_behind()
        rates = self._rates * np.float32(LAST_RATE ** (self.done / self.iterations))
        share(
            adam, len(self._table), self._table, self._gradients, self._means, self._squares, self._steps,
            view.slots, rates, self._sizes, self._least,
        )  # fmt: skip
        return float(np.square(difference).mean())

    def _gains(self, number: int, photo: Photo, shown: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """How a photo is exposed, [3], once the Gaussians have seen all; what has a matte counts as alike."""
        looks = self._looks
        if looks >= len(self._photos) and photo.alpha is None:
            if looks % len(self._photos) == 0:
                self._exposures.balance()
            known = slice(None) if photo.valid is None else photo.valid.ravel()
            self._exposures.look(number, shown.reshape(-1, 3)[known], wanted.reshape(-1, 3)[known])
        return self._exposures.gains[number]

    @property
    def _looks(self) -> int:
        """At photos, or at pictures between them, before the one of this iteration."""
        if not self._between[0]:
            return self.done
        at_photos = -(-self.done // PHOTO_EVERY)
        return self.done - at_photos if self._is_between else at_photos

    @property
    def _is_between(self) -> bool:
        """Whether this iteration shows a picture between the photos."""
        return bool(self._between[0]) and self.done % PHOTO_EVERY != 0

    def _number(self, count: int) -> int:
        """Of the picture of this iteration, of so many: each once in a round, in an order of its own."""
        turn, place = divmod(self._looks, count)
        return int(np.random.default_rng([self._seed, turn, 1]).permutation(count)[place])

    def _is_finite(self) -> bool:
        """Whether all numbers are; a Gaussian that is none is not seen, so no picture tells."""
        with np.errstate(all="ignore"):
            return bool(np.isfinite(self._table.sum()))

    def _photo(self, random: np.random.Generator) -> tuple[Photo, int | None]:
        """The next picture, of a large one a window, and the photo's number; None between the photos."""
        sizes = self._between if self._is_between else (self._photos, self._halves)
        photos = sizes[0 if self.done >= HALVED * self.iterations else 1]
        number = self._number(len(photos))
        return _window(photos[number], random), None if self._is_between else number

    def _hold_behind(self) -> None:
        """What is behind keeps its place and shape, and looks the same from everywhere."""
        behind = self._gradients[self._start.n_solid :]
        behind[:, :COLOR] = 0
        behind[:, COLOR + 3 :] = 0

    # --- interruptions ---------------------------------------------------------------------------------------------
    def _learned(self) -> dict[str, np.ndarray]:
        learned = {"table": self._table, "means": self._means, "squares": self._squares, "steps": self._steps}
        return learned | {"gains": self._exposures.gains, "gains_seen": self._exposures.seen}

    def state(self) -> dict[str, Tensor]:
        """All that resuming takes."""
        return {name: torch.from_numpy(each) for name, each in self._learned().items()} | {"done": number(self.done)}

    def resume(self, state: dict[str, Tensor]) -> None:
        """Let this fresh fit resume a state; it ends bit by bit where an uninterrupted one would.

        Raises:
            DataError: The state is of another fit; nothing is changed then.
        """
        check_alike(state, self.state())
        self.done = whole_number(state, "done", self.iterations)
        for name, each in self._learned().items():
            each[:] = state[name].numpy()


def _window(photo: Photo, random: np.random.Generator) -> Photo:
    """A photo, or of a large one a window at random."""
    height, width = photo.color.shape[:2]
    if max(width, height) <= WINDOW:
        return photo
    left, top = (int(random.integers(0, max(0, side - WINDOW) + 1)) for side in (width, height))
    return photo.window(left, top)


def _by_column(rates: Rates, n_columns: int) -> np.ndarray:
    columns = np.full(n_columns, rates.harmonics, np.float32)
    firsts = (CENTER, LOG_SCALE, ROTATION, LOGIT, COLOR, COLOR + 3)
    for first, last, rate in zip(firsts, firsts[1:], astuple(rates), strict=False):
        columns[first:last] = rate
    return columns


def _pixel_sizes(gaussians: Gaussians, photos: Sequence[Photo]) -> np.ndarray:
    """World units that a pixel spans at each Gaussian, [n], in the photo that shows it largest."""
    least = np.full(len(gaussians), np.inf)
    centers = gaussians.table[:, :3].astype(np.float64)
    for photo in photos:
        camera = photo.camera
        pixels, depth = camera.project(centers)
        with np.errstate(invalid="ignore"):
            seen = (depth > gaussians.near) & (pixels >= 0).all(1) & (pixels <= (camera.width, camera.height)).all(1)
        least[seen] = np.minimum(least[seen], depth[seen] / max(camera.fx, camera.fy))
    return np.where(np.isfinite(least), least, np.exp(gaussians.table[:, LOG_SCALE : LOG_SCALE + 3].min(1)))
