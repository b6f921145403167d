"""Colors under a reference light, and what they look like in the photos: by a gray card or a color chart in a photo.

A book gives colors as they look under daylight (D65); photos show them under the light of the scene, by the camera's
exposure, white balance and filters. A card of known gray in one photo tells the ratio of both in each channel of linear
light (von Kries; an exposure is part of it), a chart (`color_chart`) the whole matrix. Both hold where the light falls as
on them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import BadRequest
from ..io.color import lab_to_srgb, linear_to_srgb, srgb_to_lab, srgb_to_linear
from .palette import BRIGHTEST

CARD_LIGHTNESS = 50.0  # L* of a gray card, which reflects 18 % of the light
DARKEST, CLIPPED = 0.02, 0.995  # sRGB values of a card that tell nothing: no light, or more than the photo holds


@dataclass(frozen=True)
class ReferenceLight:
    """How a scene's light and its photos' exposure differ from the reference light.

    Attributes:
        matrix: From linear light under the reference light to that in the photos, [3, 3], invertible; of a gray card it is
            diagonal.
    """

    matrix: np.ndarray

    @classmethod
    def of_card(cls, photographed: np.ndarray, lightness: float = CARD_LIGHTNESS) -> ReferenceLight:
        """By what a neutral card of a lightness, L* over 0 to 100, looks like in the photos, sRGB [3] in [0, 1].

        Raises:
            BadRequest: The card is too dark or clipped there, or the lightness cannot be.

        Examples:
            A card that looks warm and bright in the photos:

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
        """What colors under the reference light, sRGB [..., 3] in [0, 1], look like in the photos, in [0, BRIGHTEST]."""
        return np.minimum(_through(self.matrix, color), BRIGHTEST)

    def reference(self, color: np.ndarray) -> np.ndarray:
        """What colors of the photos, sRGB [..., 3] in [0, BRIGHTEST], look like under the reference light, likewise.

        Examples:
            >>> light = ReferenceLight(np.diag([2.0, 1.0, 0.5]))
            >>> light.reference(light.photographed(np.array([0.2, 0.4, 0.6]))).round(3).tolist()
            [0.2, 0.4, 0.6]
        """
        return np.minimum(_through(np.linalg.inv(self.matrix), color), BRIGHTEST)

    def lab_photographed(self, lab: np.ndarray) -> np.ndarray:
        """What a color under the reference light, CIE L*a*b* [..., 3], is in the photos, even if no picture can show it."""
        return srgb_to_lab(_through(self.matrix, lab_to_srgb(lab)))

    def lab_reference(self, lab: np.ndarray) -> np.ndarray:
        """The inverse of `lab_photographed`."""
        return srgb_to_lab(_through(np.linalg.inv(self.matrix), lab_to_srgb(lab)))


def _through(matrix: np.ndarray, color: np.ndarray) -> np.ndarray:
    return linear_to_srgb(srgb_to_linear(color) @ matrix.T)
