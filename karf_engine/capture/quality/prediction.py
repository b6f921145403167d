"""How well new views of a capture will be shown: a straight line through captures that were learned and judged."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class PsnrLine:
    """Held-out PSNR of the voxels by preset `demo`, dB, of two figures that are known before anything is learned.

    The constants were fitted to 25 captures of 12 scenes: the demo, drawn seeds 0 to 7 and 20 to 22, and 13 of these
    with 12 to 22 of their photos (`tools/scenes/inspections.py`; docs/benchmark.md says what it is worth elsewhere).

    Attributes:
        start: dB.
        of_agreed: dB, from no match between neighboring photos that the cameras agree with to all.
        of_matte: dB, where nothing is behind the objects; told by two scenes.
        beyond: dB by which it exceeds `photos.plainness` at most: detail finer than voxels is not learned. The most that one
            of these captures did; without it real photos, which are full of detail, are expected to come out far too well.
        error: dB, root mean square where each scene is predicted from the others.
        of_spacing: dB for each doubling of the degrees from a new view to the nearest photo, within one scene.
        free: Degrees up to which a new view is near enough.
    """

    start: float = 13.8
    of_agreed: float = 24.5
    of_matte: float = 5.6
    beyond: float = 4.0
    error: float = 2.8
    of_spacing: float = -6.3
    free: float = 4.0

    def psnr(self, agreed: float, plainness: float, is_matte: bool) -> float:
        """What is expected, dB.

        Args:
            agreed: Share of the matches that the cameras agree with, in [0, 1].
            plainness: Of the photos, dB.
            is_matte: Whether the photos have a matte.

        Examples:
            >>> PsnrLine().psnr(0.8, 32.0, False), PsnrLine().psnr(0.8, 25.0, False)
            (33.4, 29.0)
        """
        on_line = self.start + self.of_agreed * agreed + self.of_matte * is_matte
        return round(min(on_line, plainness + self.beyond), 3)

    def gain(self, spacing: float, then: float) -> float:
        """What nearer photos bring, dB.

        Args:
            spacing: Degrees from a new view to the nearest photo.
            then: The same with more photos.

        Examples:
            >>> PsnrLine().gain(16.0, 8.0), PsnrLine().gain(3.0, 2.0)
            (6.3, 0.0)
        """
        return self.of_spacing * math.log2(max(then, self.free) / max(spacing, self.free)) + 0.0


LINE = PsnrLine()
