"""How well new views of a capture will be shown: a straight line through captures that were learned and judged."""

from __future__ import annotations

import math
from dataclasses import dataclass

MOST, LEAST = 42.0, 12.0  # dB: beyond these nothing was learned


@dataclass(frozen=True)
class PsnrLine:
    """Held-out PSNR of the voxels by preset `demo`, dB, as a linear function of three figures.

    Fitted to COUNT captures; see `docs/benchmark.md`, *Before anything is learned*.

    Attributes:
        start: dB.
        of_plainness: For each dB of `photos.plainness`.
        of_spacing: For each doubling of the degrees from a new view to the nearest photo.
        of_agreed: From no match that the cameras agree with to all.
        error: dB, root mean square where each scene is predicted from all others.
    """

    start: float = 0.0
    of_plainness: float = 0.0
    of_spacing: float = 0.0
    of_agreed: float = 0.0
    error: float = 0.0

    def psnr(self, plainness: float, spacing: float, agreed: float) -> float:
        """Predicted PSNR, dB."""
        found = self.start + self.of_plainness * plainness + self.of_agreed * agreed
        return min(MOST, max(LEAST, found + self.of_spacing * math.log2(max(spacing, 0.1))))

    def gain(self, spacing: float, then: float) -> float:
        """By how many dB it grows where new views come nearer to photos, from this spacing to that."""
        return self.of_spacing * math.log2(max(then, 0.1) / max(spacing, 0.1))


LINE = PsnrLine()
