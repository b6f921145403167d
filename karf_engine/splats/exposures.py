"""How each photo is exposed beside the others: gains of red, green and blue, learned beside the Gaussians.

Without them a photo that is brighter than its neighbors is explained by colors that change with the direction, and by
haze. A gain in sRGB is close to one in linear light but for dark tones, and takes other white balances too.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

DARKEST, BRIGHTEST = 0.02, 0.98  # sRGB; what is clipped tells no gain
HOLD = 0.0125  # squared sRGB that speaks for a gain of 1, beside the mean square of the picture
SHARE = 0.5  # of a look at a photo that counts beside all before
# deviation of logarithms of gains that what is not yet learned makes: believed, it would cost photos that are exposed
# alike 0.5 dB
NOISE = 0.01


class Exposures:
    """Gains of n photos, whose geometric mean is 1: the scene has the exposure that its photos have in the mean.

    Attributes:
        seen: [n, 3] float32, what a photo shows by what the Gaussians show.
        gains: [n, 3] float32, the same as far as it is believed: the nearer to 1, the less the photos differ.
    """

    def __init__(self, n_photos: int) -> None:
        self.seen, self.gains = (np.ones((n_photos, 3), np.float32) for _ in range(2))

    def look(self, number: int, shown: np.ndarray, photo: np.ndarray) -> None:
        """Take in a photo.

        Args:
            number: Of the photo.
            shown: [m, 3] sRGB, what the Gaussians show of its pixels.
            photo: [m, 3] sRGB in [0, 1].
        """
        told = (photo > DARKEST) & (photo < BRIGHTEST)
        of_shown = np.where(told, shown, 0)
        count = np.maximum(told.sum(0), 1)
        gain = ((of_shown * photo).sum(0) / count + HOLD) / ((of_shown * of_shown).sum(0) / count + HOLD)
        self.seen[number] += SHARE * (gain - self.seen[number])
        self.gains[number] = self.seen[number] ** self._belief()

    def balance(self) -> None:
        """Let the geometric mean of the gains be 1."""
        self.seen /= np.exp(np.log(self.seen).mean(0))
        self.gains[:] = self.seen ** self._belief()

    def _belief(self) -> np.float32:
        variance = np.log(self.seen).var()
        return variance / (variance + np.float32(NOISE**2))


def between(gains: np.ndarray, places: Sequence[int], place: int) -> np.ndarray:
    """The gains of a photo that was not learned from, as photos before and after it have them.

    Args:
        gains: [n, 3].
        places: Of these n photos in the order in which they were taken, rising.
        place: Of the photo in question.

    Returns:
        [3] float32.

    Examples:
        >>> between(np.array([[1.0, 1.0, 1.0], [1.2, 1.0, 0.8]]), [0, 2], 1)
        array([1.1, 1. , 0.9], dtype=float32)
    """
    return np.array([np.interp(place, places, channel) for channel in gains.T], np.float32)
