"""Figures that compare pictures and masks. Pictures: [H, W, 3] (or [H, W]) in [0, 1]; masks: bool [H, W]."""

from __future__ import annotations

import numpy as np

from ..color import ciede2000, srgb_to_lab

SSIM_RADIUS, SSIM_SIGMA = 5, 1.5


def psnr(first: np.ndarray, second: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Peak signal-to-noise ratio in dB for peak 1, over the mask if given; infinite for equal pictures."""
    error = _squared_error(first, second)
    mean = float(error.mean() if mask is None else error[mask].mean())
    return float("inf") if mean == 0 else -10 * float(np.log10(mean))


def mse_outside(first: np.ndarray, second: np.ndarray, mask: np.ndarray) -> float:
    """Mean squared error over pixels outside the mask and over channels; 0 where the mask covers the picture."""
    error = _squared_error(first, second)[~mask]
    return float(error.mean()) if error.size else 0.0


def mean_ciede2000(first: np.ndarray, second: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Mean CIEDE2000 of two sRGB pictures [..., 3], over the mask [...] if given; NaN for an empty mask."""
    if mask is not None:
        first, second = first[mask], second[mask]
    difference = ciede2000(srgb_to_lab(first), srgb_to_lab(second))
    return float(difference.mean()) if difference.size else float("nan")


def ssim(first: np.ndarray, second: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Structural similarity, at most 1: 11 x 11 Gaussian window of sigma 1.5, K1 = 0.01, K2 = 0.03, peak 1.

    Population covariances; mean over channels and over pixels, of the mask if given, whose window lies inside (Wang et
    al. 2004); NaN where there is none. Raises ValueError for pictures under 11 pixels.
    """
    x, y = np.atleast_3d(np.asarray(first, np.float64)), np.atleast_3d(np.asarray(second, np.float64))
    if min(x.shape[:2]) < 2 * SSIM_RADIUS + 1:
        raise ValueError(f"SSIM needs pictures of at least 11 x 11 pixels, got {x.shape[:2]}.")
    mean_x, mean_y = _gaussian(x), _gaussian(y)
    variance_x = _gaussian(x * x) - mean_x**2
    variance_y = _gaussian(y * y) - mean_y**2
    covariance = _gaussian(x * y) - mean_x * mean_y
    c1, c2 = 0.01**2, 0.03**2
    numerator = (2 * mean_x * mean_y + c1) * (2 * covariance + c2)
    similarity = numerator / ((mean_x**2 + mean_y**2 + c1) * (variance_x + variance_y + c2))
    if mask is not None:
        similarity = similarity[mask[SSIM_RADIUS:-SSIM_RADIUS, SSIM_RADIUS:-SSIM_RADIUS]]
    return float(similarity.mean()) if similarity.size else float("nan")


def iou(predicted: np.ndarray, truth: np.ndarray) -> float:
    """Intersection over union of two masks; 1 where both are empty."""
    union = np.count_nonzero(predicted | truth)
    return np.count_nonzero(predicted & truth) / union if union else 1.0


def iou_border_excluded(predicted: np.ndarray, truth: np.ndarray) -> float:
    """`iou` without the pixels that touch the truth's border (1 pixel to either side, corners included)."""
    keep = ~(_grow(truth) & _grow(~truth))
    return iou(predicted & keep, truth & keep)


def accuracy(predicted: np.ndarray, truth: np.ndarray) -> float:
    """Share of pixels, 0..1, on which two masks agree."""
    return float((predicted == truth).mean())


def _squared_error(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return (np.asarray(first, np.float64) - np.asarray(second, np.float64)) ** 2


def _gaussian(image: np.ndarray) -> np.ndarray:
    """Separable Gaussian mean over each window that lies inside the image [H, W, C]."""
    offsets = np.arange(-SSIM_RADIUS, SSIM_RADIUS + 1)
    kernel = np.exp(-0.5 * (offsets / SSIM_SIGMA) ** 2)
    kernel /= kernel.sum()
    height, width = (size - 2 * SSIM_RADIUS for size in image.shape[:2])
    rows = sum(weight * image[i : i + height] for i, weight in enumerate(kernel))
    return sum(weight * rows[:, i : i + width] for i, weight in enumerate(kernel))


def _grow(mask: np.ndarray) -> np.ndarray:
    """The mask grown by one pixel, diagonals included."""
    padded = np.pad(mask, 1)
    height, width = mask.shape
    grown = np.zeros_like(mask)
    for row in range(3):
        for column in range(3):
            grown |= padded[row : row + height, column : column + width]
    return grown
