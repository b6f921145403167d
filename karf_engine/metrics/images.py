"""How alike two pictures are. Pictures: [H, W, 3] (or [H, W]) sRGB in [0, 1]; masks: bool [H, W].

Needs scikit-image, the extra `metrics`.
"""

from __future__ import annotations

import numpy as np
from skimage.color import deltaE_ciede2000, hsv2rgb, rgb2hsv
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from ..io.color import srgb_to_lab

CORRECTION_ROUNDS, CLIPPED = 5, 0.5 / 255  # of the color correction; nearer to 0 or 1 nothing is told
SSIM_SIGMA, SSIM_RADIUS = 1.5, 5  # the window of scikit-image ends at 3.5 sigma


def psnr(first: np.ndarray, second: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Peak signal-to-noise ratio in dB for peak 1, over the mask if given; infinite for equal pictures."""
    first, second = _in_mask(first, second, mask)
    with np.errstate(divide="ignore"):
        return float(peak_signal_noise_ratio(first, second, data_range=1))


def color_corrected(shown: np.ndarray, photo: np.ndarray) -> np.ndarray:
    """A rendered picture with the exposure and white balance of its photo, as multinerf and gsplat correct colors.

    Channel by channel a least-squares fit of the photo on products and squares, values and 1 of the picture, over pixels
    that are not clipped, in five rounds (Mildenhall et al. 2022, `multinerf`, color_correct). The photo itself tells its
    colors, so nothing is foretold.

    Args:
        shown: [H, W, 3] sRGB in [0, 1].
        photo: [H, W, 3], likewise.

    Returns:
        [H, W, 3] float64 in [0, 1]; a channel that is clipped nearly everywhere stays as it is.
    """
    pixels, wanted = (np.array(each, np.float64).reshape(-1, 3) for each in (shown, photo))
    told = _is_told(pixels) & _is_told(wanted)
    for _ in range(CORRECTION_ROUNDS):
        products = [pixels[:, c, None] * pixels[:, c:] for c in range(3)]
        terms = np.concatenate([*products, pixels, np.ones((len(pixels), 1))], 1)
        fitted = told & _is_told(pixels)
        for c in range(3):
            own = fitted[:, c]
            if own.sum() >= terms.shape[1]:  # fewer pixels settle nothing
                pixels[:, c] = (terms @ np.linalg.lstsq(terms[own], wanted[own, c], rcond=None)[0]).clip(0, 1)
    return pixels.reshape(np.shape(shown))


def cc_psnr(shown: np.ndarray, photo: np.ndarray) -> float:
    """PSNR in dB of a rendered picture [H, W, 3] with its photo's colors (`color_corrected`) and the photo."""
    return psnr(color_corrected(shown, photo), photo)


def mse_outside(first: np.ndarray, second: np.ndarray, mask: np.ndarray) -> float:
    """Mean squared error over pixels outside the mask and over channels; 0 where the mask covers the picture."""
    first, second = _in_mask(first, second, ~mask)
    return float(((first - second) ** 2).mean()) if first.size else 0.0


def mean_ciede2000(first: np.ndarray, second: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Mean CIEDE2000 of two sRGB pictures [..., 3], over the mask [...] if given; NaN for an empty mask."""
    first, second = _in_mask(first, second, mask)
    return float(deltaE_ciede2000(srgb_to_lab(first), srgb_to_lab(second)).mean()) if first.size else float("nan")


def ssim(first: np.ndarray, second: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Structural similarity, at most 1: 11 x 11 Gaussian window of sigma 1.5, K1 = 0.01, K2 = 0.03, peak 1.

    Population covariances; mean over channels and over pixels, of the mask if given, whose window lies inside (Wang et
    al. 2004).

    Returns:
        NaN where no pixel of the mask has its window inside.

    Raises:
        ValueError: The pictures are smaller than 11 pixels.
    """
    first, second = (np.atleast_3d(np.asarray(picture, np.float64)) for picture in (first, second))
    window = {"gaussian_weights": True, "sigma": SSIM_SIGMA, "use_sample_covariance": False}
    _, similarity = structural_similarity(first, second, data_range=1, channel_axis=2, full=True, **window)
    inside = (slice(SSIM_RADIUS, -SSIM_RADIUS),) * 2
    similarity = similarity[inside] if mask is None else similarity[inside][mask[inside]]
    return float(similarity.mean()) if similarity.size else float("nan")


def hue_shift(image: np.ndarray, source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """The usual recipe, as a baseline: rotate every pixel's HSV hue by the hue difference of target and source.

    Args:
        image: [..., 3] sRGB in [0, 1].
        source: [3], the color that is to change.
        target: [3], what it is to become.

    Returns:
        [..., 3] float64.
    """
    hsv = rgb2hsv(np.asarray(image, np.float64))
    hsv[..., 0] = (hsv[..., 0] + rgb2hsv(target)[0] - rgb2hsv(source)[0]) % 1
    return hsv2rgb(hsv)


def _is_told(values: np.ndarray) -> np.ndarray:
    return (values >= CLIPPED) & (values <= 1 - CLIPPED)


def _in_mask(first: np.ndarray, second: np.ndarray, mask: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Both pictures as float64, of the mask's pixels only if one is given."""
    first, second = np.asarray(first, np.float64), np.asarray(second, np.float64)
    return (first, second) if mask is None else (first[mask], second[mask])
