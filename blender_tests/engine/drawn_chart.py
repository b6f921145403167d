"""Photos of a color chart, drawn with a known light, perspective, blur and noise."""

import cv2
import numpy as np

from karf_engine.io.color import linear_to_srgb, srgb_to_linear
from karf_engine.palettes.calibration import COLUMNS, reference_colors

SIZE, BORDER, GAP = 40, 12, 4  # pixels: of a patch, around the patches, between two
CAST = np.array([[0.85, 0.10, 0.02], [0.05, 0.75, 0.05], [0.02, 0.08, 0.50]])  # daylight to photo, linear
CORNERS = np.array([[150.0, 140], [620, 180], [590, 470], [170, 430]])  # of the block of patches, the brown one first
ROOM = (0.25, 0.22, 0.20)  # behind the chart, linear


def photo_of_chart(matrix=CAST, corners=CORNERS, noise=2 / 255, size=(800, 600)) -> np.ndarray:
    """An 8-bit sRGB photo [H, W, 3] of the chart."""
    step, across, down = SIZE + GAP, 5 * (SIZE + GAP) + SIZE, 3 * (SIZE + GAP) + SIZE
    flat = np.full((down + 2 * BORDER, across + 2 * BORDER, 3), 0.01)
    for number, light in enumerate(srgb_to_linear(reference_colors()) @ np.transpose(matrix)):
        row, column = divmod(number, COLUMNS)
        top, left = BORDER + row * step, BORDER + column * step
        flat[top : top + SIZE, left : left + SIZE] = light
    block = np.array([[0, 0], [across, 0], [across, down], [0, down]]) + BORDER
    tilt = cv2.getPerspectiveTransform(block.astype(np.float32), np.asarray(corners, np.float32))
    seen = cv2.warpPerspective(flat, tilt, size, borderMode=cv2.BORDER_CONSTANT, borderValue=ROOM)
    photo = linear_to_srgb(np.clip(cv2.GaussianBlur(seen, (0, 0), 1.0), 0, 1))
    photo += np.random.default_rng(0).normal(0, noise, photo.shape)
    return np.rint(255 * np.clip(photo, 0, 1)) / 255
