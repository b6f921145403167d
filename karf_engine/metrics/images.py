"""Similarity of two pictures, [H, W, 3] (or [H, W]) sRGB in [0, 1]; masks are bool [H, W].

Needs scikit-image, the extra `metrics`.
"""

from __future__ import annotations

import numpy as np
from skimage.color import deltaE_ciede2000, hsv2rgb, rgb2hsv
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from ..io.color import srgb_to_lab

CORRECTION_ROUNDS, CLIPPED = 5, 0.5 / 255  # of the color correction; values closer to 0 or 1 count as clipped
SSIM_SIGMA, SSIM_RADIUS = 1.5, 5  # scikit-image truncates the window at 3.5 sigma


def psnr(first: np.ndarray, second: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Return the peak signal-to-noise ratio in dB for peak 1, over the mask if given; infinite for equal pictures."""
    first, second = _in_mask(first, second, mask)
    with np.errstate(divide="ignore"):
        return float(peak_signal_noise_ratio(first, second, data_range=1))


def color_correct(shown: np.ndarray, photo: np.ndarray) -> np.ndarray:
    """Return a rendered picture with the exposure and white balance of its photo, [H, W, 3] float64 in [0, 1].

    Each channel is a least-squares fit on quadratic polynomials of the picture, over pixels that are not clipped, in five
    rounds (Mildenhall et al. 2022, `multinerf`, color_correct). A channel with hardly any such pixels is unchanged.
    """
    pixels, target = (np.array(each, np.float64).reshape(-1, 3) for each in (shown, photo))
    usable = _is_unclipped(pixels) & _is_unclipped(target)
    for _ in range(CORRECTION_ROUNDS):
        products = [pixels[:, c, None] * pixels[:, c:] for c in range(3)]
        terms = np.concatenate([*products, pixels, np.ones((len(pixels), 1))], 1)
        fitted = usable & _is_unclipped(pixels)
        for c in range(3):
            own = fitted[:, c]
            if own.sum() >= terms.shape[1]:
                pixels[:, c] = (terms @ np.linalg.lstsq(terms[own], target[own, c], rcond=None)[0]).clip(0, 1)
    return pixels.reshape(np.shape(shown))


def cc_psnr(shown: np.ndarray, photo: np.ndarray) -> float:
    """Return the PSNR in dB of a rendered picture [H, W, 3], color-corrected, against its photo."""
    return psnr(color_correct(shown, photo), photo)


def mse_outside(first: np.ndarray, second: np.ndarray, mask: np.ndarray) -> float:
    """Return the mean squared error outside the mask, over channels; 0 where the mask covers the picture."""
    first, second = _in_mask(first, second, ~mask)
    return float(((first - second) ** 2).mean()) if first.size else 0.0


def mean_ciede2000(first: np.ndarray, second: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Return the mean CIEDE2000 of sRGB pictures [..., 3], over the mask [...] if given; NaN for an empty mask."""
    first, second = _in_mask(first, second, mask)
    return float(deltaE_ciede2000(srgb_to_lab(first), srgb_to_lab(second)).mean()) if first.size else float("nan")


def ssim(first: np.ndarray, second: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Return the structural similarity, at most 1, over the pixels (of the mask if given) whose window is in the picture.

    11 x 11 Gaussian window of sigma 1.5, K1 = 0.01, K2 = 0.03, peak 1, population covariances, mean over channels (Wang
    et al. 2004). NaN without such pixels. Raises ValueError for pictures smaller than 11 pixels.
    """
    first, second = (np.atleast_3d(np.asarray(picture, np.float64)) for picture in (first, second))
    window = {"gaussian_weights": True, "sigma": SSIM_SIGMA, "use_sample_covariance": False}
    similarity = structural_similarity(first, second, data_range=1, channel_axis=2, full=True, **window)[1]
    inside = (slice(SSIM_RADIUS, -SSIM_RADIUS),) * 2
    similarity = similarity[inside] if mask is None else similarity[inside][mask[inside]]
    return float(similarity.mean()) if similarity.size else float("nan")


def hue_shift(image: np.ndarray, source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Rotate the HSV hue of pixels [..., 3] by that of target [3] minus source [3]: a baseline for recoloring."""
    hsv = rgb2hsv(np.asarray(image, np.float64))
    hsv[..., 0] = (hsv[..., 0] + rgb2hsv(target)[0] - rgb2hsv(source)[0]) % 1
    return hsv2rgb(hsv)


def _is_unclipped(values: np.ndarray) -> np.ndarray:
    return (values >= CLIPPED) & (values <= 1 - CLIPPED)


def _in_mask(first: np.ndarray, second: np.ndarray, mask: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Return both pictures as float64, reduced to the mask's pixels if one is given."""
    first, second = np.asarray(first, np.float64), np.asarray(second, np.float64)
    return (first, second) if mask is None else (first[mask], second[mask])
