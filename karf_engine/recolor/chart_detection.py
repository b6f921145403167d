"""Color charts in photos, found by OpenCV's detector; its box is a little wider than the block of patches."""

from __future__ import annotations

import cv2
import numpy as np

from ..io.color import to_bytes


def find_corners(photo: np.ndarray) -> np.ndarray | None:
    """Find the corners of a chart's block of patches, as `palettes.calibration.patch_colors` takes them, or None.

    Args:
        photo: sRGB [H, W, 3] in [0, 1].
    """
    detector = cv2.mcc.CCheckerDetector_create()  # pyright: ignore[reportAttributeAccessIssue]
    detector.setColorChartType(cv2.mcc.MCC24)
    found = detector.process(np.ascontiguousarray(to_bytes(photo[..., ::-1])), 1)
    return detector.getBestColorChecker().getBox().astype(np.float64) if found else None
