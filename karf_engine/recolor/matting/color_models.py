"""Which colors objects and surroundings have in one photo, and where in it.

All classes share one set of Gaussians in CIE Lab (`mixtures`); a class is its shares of them, and these shares vary
over the photo: what stands beside a leaf tells more about its edge than what stands elsewhere in the picture.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...segmentation.gaussian_mixtures import Mixture, fit_mixture


@dataclass(frozen=True)
class ColorParameters:
    """What color models of a photo are fitted with. Set together, when mattes were first made; not varied on record.

    Attributes:
        components: Gaussians that the classes share.
        draws: Pixels that they are fitted to.
        window: Standard deviation of the window of a place's own shares, pixels of the field's picture.
        whole_photo: Weight of the shares in the whole photo, beside a window that is full of the class.
        least_share: Of each Gaussian in each class.
        stride: Shares vary slowly, and are kept at every 4th pixel.
    """

    components: int = 20
    draws: int = 5000
    window: float = 12.0
    whole_photo: float = 0.1
    least_share: float = 1e-5
    stride: int = 4


PARAMETERS = ColorParameters()


@dataclass(frozen=True)
class ColorModels:
    """The colors of C classes in one photo.

    Attributes:
        mixture: Of m Gaussians in CIE Lab.
        shares: [h', w', C, m] float32, what part each Gaussian has in each class about each place of a coarse grid that
            is laid over the whole photo; sums to 1 over m.
    """

    mixture: Mixture
    shares: np.ndarray

    def log_densities(self, lab: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Natural logarithm of each class's density at n colors.

        Args:
            lab: [n, 3] CIE Lab.
            places: [n, 2] where in the photo, (row, column) in [0, 1].

        Returns:
            [n, C].
        """
        parts = self.mixture.log_components(lab)
        top = parts.max(1, keepdims=True)
        size = np.array(self.shares.shape[:2])
        cells = np.minimum((places * size).astype(np.intp), size - 1)
        shares = self.shares[cells[:, 0], cells[:, 1]]
        return top + np.log(np.einsum("ncm,nm->nc", shares, np.exp(parts - top).astype(np.float32)))


def fit_color_models(lab: np.ndarray, strengths: np.ndarray, random: np.random.Generator) -> ColorModels:
    """Fit the colors of classes.

    Args:
        lab: [h, w, 3] CIE Lab.
        strengths: [C, h, w] >= 0, how far a pixel stands for a class; not all zero.
        random: Draws the pixels that the Gaussians are fitted to.
    """
    known = np.flatnonzero(strengths.any(0))
    colors = lab.reshape(-1, 3)[known]
    totals = np.maximum(strengths.sum((1, 2)), 1e-12)
    # small objects count as much as large ones
    even = strengths.reshape(len(strengths), -1)[:, known] / totals[:, None]
    mixture = fit_mixture(colors, even.sum(0), PARAMETERS.components, random, PARAMETERS.draws)
    responsibilities = mixture.responsibilities(mixture.log_components(colors)).astype(np.float32)
    return ColorModels(mixture, _local_shares(strengths, known, responsibilities))


def _local_shares(strengths: np.ndarray, known: np.ndarray, responsibilities: np.ndarray) -> np.ndarray:
    """Shares [h', w', C, m] of each class about each place; responsibilities [n, m] are those of the pixels `known`."""
    n_classes, height, width = strengths.shape
    result = []
    for strength in strengths.reshape(n_classes, -1).astype(np.float32):
        whole = strength[known] @ responsibilities / max(strength.sum(), 1e-12)
        stood_for = _windowed(strength.reshape(height, width))
        spread = np.zeros((height * width, responsibilities.shape[1]), np.float32)
        spread[known] = strength[known, None] * responsibilities
        local = np.stack([_windowed(plane.reshape(height, width)) for plane in spread.T], -1)
        result.append((local + PARAMETERS.whole_photo * whole) / (stood_for + PARAMETERS.whole_photo)[..., None])
    return np.maximum(np.stack(result, 2), PARAMETERS.least_share)


def _windowed(plane: np.ndarray) -> np.ndarray:
    """Mean of a plane [h, w] in a Gaussian window about every place of the coarse grid."""
    height, width = plane.shape
    size = (-(-width // PARAMETERS.stride), -(-height // PARAMETERS.stride))
    return cv2.GaussianBlur(
        cv2.resize(plane, size, interpolation=cv2.INTER_AREA), (0, 0), PARAMETERS.window / PARAMETERS.stride
    )


def posterior(models: ColorModels, lab: np.ndarray, places: np.ndarray, priors: np.ndarray) -> np.ndarray:
    """What n colors and prior probabilities make of each class.

    Args:
        models: Colors of C classes.
        lab: [n, 3] CIE Lab.
        places: [n, 2] where in the photo, (row, column) in [0, 1].
        priors: [C, n] >= 0.

    Returns:
        float32 [C, n]; sums to 1 over C.
    """
    with np.errstate(divide="ignore"):
        logs = models.log_densities(lab, places).T + np.log(priors)
    odds = np.exp(logs - logs.max(0))
    return (odds / odds.sum(0)).astype(np.float32)
