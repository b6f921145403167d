"""Training of Gaussians on photos: mean squared error, sparse Adam, and an exposure of each photo."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from ..capture.camera import Camera
from ..capture.capture import View
from ..capture.training_images import TrainingImage, load_views
from ..compute.progress import Progress
from ..errors import Diverged
from ..fields.fit import Checkpoint, end_iteration
from ..fields.training import check_same_layout, read_integer, scalar_tensor
from ..io.color import to_bytes
from ..io.images import resize
from .gaussians import Gaussians
from .kernels.arrays import CENTER, COLOR, LOG_SCALE, LOGIT, ROTATION
from .rasterizer import Device, pinhole, rasterize, trained_table

WINDOW = 400  # side of the windows of larger photos, pixels
HALVED = 0.6  # fraction of the iterations, at the start, with photos at half size
PHOTO_EVERY = 3  # with pictures between the photos: every third iteration shows a photo
# learning rates by first column: 4 to 16 times those of Kerbl et al. 2023, for hundreds of iterations instead of tens of
# thousands; of the centers in units of each Gaussian's size
RATES = {CENTER: 0.2, LOG_SCALE: 0.16, ROTATION: 0.03, LOGIT: 0.1, COLOR: 0.02, COLOR + 3: 0.008}
LAST_RATE = 0.05  # factor of the learning rates at the end
LEAST_PIXELS = 0.1  # least scale of a Gaussian, pixels of the photo that shows it largest
DARKEST, BRIGHTEST = 0.02, 0.98  # sRGB range of pixels that are not clipped
PRIOR = 0.0125  # squared sRGB, added to both moments as a prior for a gain of 1
MOMENTUM = 0.5  # weight of the newest estimate
NOISE = 0.01  # standard deviation of log gains caused by incomplete training


@dataclass(frozen=True)
class Photo:
    """Training photo."""

    camera: Camera  # pinhole
    color: np.ndarray  # uint8 sRGB [H, W, 3], straight alpha
    alpha: np.ndarray | None  # float32 [H, W]; None if opaque
    valid: np.ndarray | None  # bool [H, W], False for pixels to ignore; None if all are valid

    @classmethod
    def of(cls, image: TrainingImage) -> Photo:
        """Convert a training image to a quarter of its memory."""
        return cls(image.camera, to_bytes(image.color), image.alpha, image.valid)

    def over(self, background: Sequence[float]) -> np.ndarray:
        """Composite the photo over an sRGB color, [H, W, 3] float32."""
        color = self.color.astype(np.float32) / 255
        if self.alpha is None:
            return color
        return self.alpha[..., None] * color + (1 - self.alpha[..., None]) * np.array(background, np.float32)

    def halved(self) -> Photo:
        """Return the photo at half size."""
        height, width = (max(1, side // 2) for side in self.color.shape[:2])
        color = to_bytes(resize(self.color.astype(np.float32) / 255, width, height))
        alpha = None if self.alpha is None else resize(self.alpha, width, height)
        valid = None if self.valid is None else resize(self.valid.astype(np.float32), width, height) > 0.999
        return Photo(self.camera.scaled(width, height), color, alpha, valid)

    def cropped(self, rows: slice, columns: slice) -> Photo:
        """Return a copy of these rows and columns."""
        camera, color = self.camera, self.color[rows, columns].copy()
        alpha, valid = (None if each is None else each[rows, columns].copy() for each in (self.alpha, self.valid))
        size = {"width": color.shape[1], "height": color.shape[0]}
        return Photo(
            replace(camera, **size, cx=camera.cx - columns.start, cy=camera.cy - rows.start), color, alpha, valid
        )


class Exposures:
    """Exposures of n photos relative to each other: gains of red, green and blue with a geometric mean of 1.

    Without gains, brighter photos are explained by view-dependent colors and haze. A gain in sRGB is close to one in
    linear light except in dark tones, and also covers white balance.
    """

    def __init__(self, n_photos: int) -> None:
        self.measured = np.ones((n_photos, 3), np.float32)  # estimates of photo / rendering
        self.gains = np.ones((n_photos, 3), np.float32)  # shrunk toward 1, the more the less the photos differ

    def update(self, number: int, shown: np.ndarray, photo: np.ndarray) -> None:
        """Update the gains of one photo by rendered and own pixels, [m, 3] sRGB each."""
        usable = (photo > DARKEST) & (photo < BRIGHTEST)
        usable_shown = np.where(usable, shown, 0)
        count = np.maximum(usable.sum(0), 1)
        gain = ((usable_shown * photo).sum(0) / count + PRIOR) / ((usable_shown * usable_shown).sum(0) / count + PRIOR)
        self.measured[number] += MOMENTUM * (gain - self.measured[number])
        self.gains[number] = self.measured[number] ** self._shrinkage()

    def balance(self) -> None:
        """Normalize the geometric mean of the gains to 1."""
        self.measured /= np.exp(np.log(self.measured).mean(0))
        self.gains[:] = self.measured ** self._shrinkage()

    def _shrinkage(self) -> np.float32:
        """Return the fraction of the variance of log gains that is not noise."""
        variance = np.log(self.measured).var()
        return variance / (variance + np.float32(NOISE**2))


class SplatFit:
    """Fit of Gaussians to photos. Of `iterations`, `done` are completed."""

    def __init__(
        self,
        gaussians: Gaussians,
        photos: Sequence[Photo],
        iterations: int,
        seed: int,
        pseudo_photos: Sequence[Photo] = (),
        device: Device = "cpu",
        halved: float = HALVED,
        fits_exposures: bool = True,
    ) -> None:
        """Start with initial Gaussians, which are not modified.

        Each iteration shows a photo or a window of one; of three, two show `pseudo_photos` of the field, if any. The
        first ones, the fraction `halved`, show them at half size. fits_exposures: False keeps all gains at 1: they would
        only explain what Gaussians cannot show, such as a sharp horizon.
        """
        self.iterations, self.done = iterations, 0
        self._start, self._photos, self._seed = gaussians, photos, seed
        self._exposures, self._halved, self._fits_exposures = Exposures(len(photos)), halved, fits_exposures
        self._halves = [photo.halved() for photo in photos]
        self._between = pseudo_photos, [picture.halved() for picture in pseudo_photos]
        least = np.log(LEAST_PIXELS * _pixel_sizes(gaussians, photos)).astype(np.float32)
        self._table = trained_table(gaussians, least, device)
        self._rates = np.empty(gaussians.table.shape[1], np.float32)
        for first, rate in RATES.items():
            self._rates[first:] = rate

    @property
    def gaussians(self) -> Gaussians:
        """Copy of the current Gaussians."""
        return replace(self._start, table=self._table.tensors()["table"].cpu().numpy().copy())

    @property
    def gains(self) -> np.ndarray:
        """Exposure gains of each photo, [n, 3] float32."""
        return self._exposures.gains

    def run(self, progress: Progress, checkpoint: Checkpoint | None = None) -> None:
        """Run the remaining iterations. Raises Diverged if the error is not finite, and Cancelled."""
        while self.done < self.iterations:
            error = self._step()
            # Gaussians that are not finite are not seen in the picture
            if not (np.isfinite(error) and self._table.is_finite()):
                raise Diverged(
                    "Training diverged at iteration {iteration}: loss {loss}.",
                    "Lower the learning rate.",
                    iteration=self.done,
                    loss=float(error),
                )
            self.done += 1
            end_iteration(progress, checkpoint, psnr=-10 * np.log10(error + 1e-10))

    def _step(self) -> float:
        """Train on one photo; return its mean squared error."""
        random = np.random.default_rng([self._seed, self.done])
        photo, number = self._photo(random)
        # a random background behind a matte requires opacity where the photo is solid
        background = self._start.background if photo.alpha is None else tuple(random.random(3))
        camera = pinhole(photo.camera, self._start.near, self._start.screen_filter)
        view = self._table.view(camera, background)
        shown, target = view.image[..., :3], photo.over(background)
        gains = 1 if number is None else self._gains(number, photo, shown, target)
        difference = gains * shown - target
        if photo.valid is not None:
            difference *= photo.valid[..., None]
        rates = self._rates * np.float32(LAST_RATE ** (self.done / self.iterations))
        self._table.update(view, gains * difference * np.float32(2 / difference.size), rates)
        return float(np.square(difference).mean())

    def _gains(self, number: int, photo: Photo, shown: np.ndarray, target: np.ndarray) -> np.ndarray:
        """Return the gains of a photo [3], updated after the first pass over all photos; photos with a matte keep 1."""
        count = self._shown_before()
        if self._fits_exposures and count >= len(self._photos) and photo.alpha is None:
            if count % len(self._photos) == 0:
                self._exposures.balance()
            valid = slice(None) if photo.valid is None else photo.valid.ravel()
            self._exposures.update(number, shown.reshape(-1, 3)[valid], target.reshape(-1, 3)[valid])
        return self._exposures.gains[number]

    @property
    def _is_between(self) -> bool:
        """True if this iteration shows a picture between the photos."""
        return bool(self._between[0]) and self.done % PHOTO_EVERY != 0

    def _shown_before(self) -> int:
        """Return the number of previous iterations with photos, or with pictures between them, as in this iteration."""
        if not self._between[0]:
            return self.done
        n_photos = -(-self.done // PHOTO_EVERY)
        return self.done - n_photos if self._is_between else n_photos

    def _photo(self, random: np.random.Generator) -> tuple[Photo, int | None]:
        """Return the picture of this iteration and the photo's number, None between the photos.

        Each picture is shown once per epoch, in random order; of large ones a random window.
        """
        sizes = self._between if self._is_between else (self._photos, self._halves)
        photos = sizes[0 if self.done >= self._halved * self.iterations else 1]
        epoch, position = divmod(self._shown_before(), len(photos))
        number = int(np.random.default_rng([self._seed, epoch, 1]).permutation(len(photos))[position])
        photo = photos[number]
        height, width = photo.color.shape[:2]
        if max(width, height) > WINDOW:
            left, top = (int(random.integers(0, max(0, side - WINDOW) + 1)) for side in (width, height))
            photo = photo.cropped(slice(top, top + WINDOW), slice(left, left + WINDOW))
        return photo, None if self._is_between else number

    def _learned(self) -> dict[str, Tensor]:
        gains = {"gains": self._exposures.gains, "gains_seen": self._exposures.measured}
        return self._table.tensors() | {name: torch.from_numpy(each) for name, each in gains.items()}

    def state(self) -> dict[str, Tensor]:
        """Return the tensors to resume from."""
        return self._learned() | {"done": scalar_tensor(self.done)}

    def resume(self, state: dict[str, Tensor]) -> None:
        """Resume this new fit, to the bit. Raises DataError, with nothing changed, for a state of another fit."""
        check_same_layout(state, self.state())
        self.done = read_integer(state, "done", self.iterations)
        for name, each in self._learned().items():
            each.copy_(state[name])


def load_photos(views: Sequence[View], long_side: int) -> list[Photo]:
    """Load the photos of these views, one at a time: as floats they need more memory."""
    return [Photo.of(load_views([view], long_side)[0]) for view in views]


def _pixel_sizes(gaussians: Gaussians, photos: Sequence[Photo]) -> np.ndarray:
    """Return the size of a pixel at each Gaussian in the photo that shows it largest, [n] world units."""
    least = np.full(len(gaussians), np.inf)
    centers = gaussians.table[:, :3].astype(np.float64)
    for photo in photos:
        camera = photo.camera
        pixels, depth = camera.project(centers)
        with np.errstate(invalid="ignore"):
            seen = (depth > gaussians.near) & (pixels >= 0).all(1) & (pixels <= (camera.width, camera.height)).all(1)
        least[seen] = np.minimum(least[seen], depth[seen] / max(camera.fx, camera.fy))
    return np.where(np.isfinite(least), least, np.exp(gaussians.table[:, LOG_SCALE : LOG_SCALE + 3].min(1)))


def interpolate_gains(gains: np.ndarray, places: Sequence[int], place: int) -> np.ndarray:
    """Interpolate gains [n, 3] of photos at ascending places in shooting order for a held-out photo."""
    return np.array([np.interp(place, places, channel) for channel in gains.T], np.float32)


def psnr(
    gaussians: Gaussians, photos: Sequence[Photo], gains: np.ndarray | float = 1.0, device: Device = "cpu"
) -> float:
    """Return the PSNR in dB, at most 100, of the mean squared error over photos. gains: their exposure, [3] sRGB."""
    return -10 * float(np.log10(np.mean([_squared_error(gaussians, photo, gains, device) for photo in photos]) + 1e-10))


def _squared_error(gaussians: Gaussians, photo: Photo, gains: np.ndarray | float, device: Device) -> float:
    shown = (np.float32(gains) * rasterize(gaussians, photo.camera, None, device).image[..., :3]).clip(0, 1)
    squares = np.square(shown - photo.over(gaussians.background))
    return float((squares if photo.valid is None else squares[photo.valid]).mean())
