"""Convert colors between a reference light and the photos, by a gray card or a color chart in a photo.

Color books give colors under daylight (D65); photos have the scene's light, exposure, white balance and filters. A
gray card determines one factor of linear light per channel (von Kries), a chart (`color_chart`) a full matrix.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import BadRequest
from ..io.color import lab_to_srgb, linear_to_srgb, srgb_to_lab, srgb_to_linear
from .palette import MAX_SRGB

CARD_LIGHTNESS = 50.0  # L* of an 18 % gray card
DARKEST, CLIPPED = 0.02, 0.995  # range of usable sRGB values


@dataclass(frozen=True)
class ReferenceLight:
    """Difference between the reference light and the light and exposure of the photos.

    Attributes:
        matrix: [3, 3], invertible, from linear light under the reference to that of the photos; diagonal for a gray
            card.
    """

    matrix: np.ndarray

    @classmethod
    def of_card(cls, photographed: np.ndarray, lightness: float = CARD_LIGHTNESS) -> ReferenceLight:
        """Calibrate by the photographed color, sRGB [3], of a neutral card with this L*.

        Raises:
            BadRequest: The card is too dark or clipped, or the lightness is out of range.

        Examples:
            >>> light = ReferenceLight.of_card(np.array([0.6, 0.5, 0.4]))
            >>> light.photographed(lab_to_srgb(np.array([50.0, 0, 0]))).round(2).tolist()
            [0.6, 0.5, 0.4]
        """
        photographed = np.asarray(photographed, np.float64)
        if not 0 < lightness <= 100:
            raise BadRequest(f"A card cannot have the lightness {lightness!r}.", "Give its L*, over 0 up to 100.")
        if not ((photographed > DARKEST) & (photographed < CLIPPED)).all():
            raise BadRequest(
                "The gray card is too dark or too bright in the photo.", "Pick a spot where it is lit, and not clipped."
            )
        card = srgb_to_linear(np.clip(lab_to_srgb(np.array([lightness, 0, 0])), 0, 1))
        return cls(np.diag(srgb_to_linear(photographed) / card))

    def photographed(self, color: np.ndarray) -> np.ndarray:
        """Convert colors under the reference light, sRGB [..., 3] in [0, 1], to the photos, in [0, BRIGHTEST]."""
        return np.minimum(_transformed(self.matrix, color), MAX_SRGB)

    def reference(self, color: np.ndarray) -> np.ndarray:
        """Convert colors of the photos to the reference light, both sRGB [..., 3] in [0, BRIGHTEST].

        Examples:
            >>> light = ReferenceLight(np.diag([2.0, 1.0, 0.5]))
            >>> light.reference(light.photographed(np.array([0.2, 0.4, 0.6]))).round(3).tolist()
            [0.2, 0.4, 0.6]
        """
        return np.minimum(_transformed(np.linalg.inv(self.matrix), color), MAX_SRGB)

    def lab_photographed(self, lab: np.ndarray) -> np.ndarray:
        """Convert colors under the reference light, CIE L*a*b* [..., 3], to the photos, without clipping."""
        return srgb_to_lab(_transformed(self.matrix, lab_to_srgb(lab)))

    def lab_reference(self, lab: np.ndarray) -> np.ndarray:
        """Invert `lab_photographed`."""
        return srgb_to_lab(_transformed(np.linalg.inv(self.matrix), lab_to_srgb(lab)))


def _transformed(matrix: np.ndarray, color: np.ndarray) -> np.ndarray:
    return linear_to_srgb(srgb_to_linear(color) @ matrix.T)
