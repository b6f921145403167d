"""Exposure of each photo relative to the others: gains of red, green and blue, estimated during training.

Without gains, brighter photos are explained by view-dependent colors and haze. A gain in sRGB is close to one in linear
light except in dark tones, and also covers white balance.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

DARKEST, BRIGHTEST = 0.02, 0.98  # sRGB range of pixels that are not clipped
PRIOR = 0.0125  # squared sRGB, added to both moments as a prior for a gain of 1
MOMENTUM = 0.5  # weight of the newest estimate
NOISE = 0.01  # standard deviation of log gains caused by incomplete training


class Exposures:
    """Gains of n photos with a geometric mean of 1.

    Attributes:
        measured: [n, 3] float32, estimates of photo / rendering.
        gains: [n, 3] float32, the estimates shrunk toward 1, the more the less the photos differ.
    """

    def __init__(self, n_photos: int) -> None:
        self.measured, self.gains = (np.ones((n_photos, 3), np.float32) for _ in range(2))

    def update(self, number: int, shown: np.ndarray, photo: np.ndarray) -> None:
        """Update the gains of one photo.

        Args:
            number: Index of the photo.
            shown: [m, 3] sRGB, rendered pixels.
            photo: [m, 3] sRGB in [0, 1], the photo's pixels.
        """
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


def interpolate_gains(gains: np.ndarray, places: Sequence[int], place: int) -> np.ndarray:
    """Interpolate the gains of a held-out photo between the photos before and after it.

    Args:
        gains: [n, 3], of the training photos.
        places: Positions of these n photos in shooting order, ascending.
        place: Position of the held-out photo.

    Returns:
        [3] float32.

    Examples:
        >>> interpolate_gains(np.array([[1.0, 1.0, 1.0], [1.2, 1.0, 0.8]]), [0, 2], 1)
        array([1.1, 1. , 0.9], dtype=float32)
    """
    return np.array([np.interp(place, places, channel) for channel in gains.T], np.float32)
