"""Where a color chart lies in a photo: by OpenCV's detector, whose box is a little wider than the block of patches."""

from __future__ import annotations

import cv2
import numpy as np

from ..io.color import to_bytes


def find_corners(photo: np.ndarray) -> np.ndarray | None:
    """The corners of a chart's block of patches in a photo, as `palettes.color_chart.patch_colors` takes them; None where none is seen.

    Args:
        photo: sRGB [H, W, 3] in [0, 1].
    """
    detector = cv2.mcc.CCheckerDetector_create()
    detector.setColorChartType(cv2.mcc.MCC24)
    found = detector.process(np.ascontiguousarray(to_bytes(photo[..., ::-1])), 1)
    return detector.getBestColorChecker().getBox().astype(np.float64) if found else None
