"""Color distributions of classes in one photo, varying over the photo.

All classes share one Gaussian mixture in CIE Lab; a class is its mixture weights, estimated in a window around each
place: the colors next to an edge say more about it than those elsewhere in the photo.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...segmentation.gaussian_mixtures import Mixture, fit_mixture

WINDOW = 12.0  # pixels of the field's picture: standard deviation of the window of local mixture weights
GLOBAL_WEIGHT = 0.1  # of the whole photo's mixture weights, relative to a window full of the class
MIN_WEIGHT = 1e-5  # of each component in each class
STRIDE = 4  # pixels between places: mixture weights vary slowly


@dataclass(frozen=True)
class ColorModels:
    """The colors of C classes in one photo."""

    mixture: Mixture  # of m Gaussians in CIE Lab
    shares: np.ndarray  # [h', w', C, m] float32, mixture weights on a coarse grid over the photo; sum to 1 over m

    def log_densities(self, lab: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Return log densities [n, C] at colors [n, 3] and places (row, column) [n, 2] in [0, 1] of the photo."""
        parts = self.mixture.log_components(lab)
        top = parts.max(1, keepdims=True)
        size = np.array(self.shares.shape[:2])
        cells = np.minimum((places * size).astype(np.intp), size - 1)
        shares = self.shares[cells[:, 0], cells[:, 1]]
        return top + np.log(np.einsum("ncm,nm->nc", shares, np.exp(parts - top).astype(np.float32)))


def fit_color_models(lab: np.ndarray, strengths: np.ndarray, random: np.random.Generator) -> ColorModels:
    """Fit the colors of C classes to a photo, [h, w, 3] CIE Lab.

    strengths: [C, h, w] >= 0, weight of each pixel as a sample of each class; not all zero.
    """
    known = np.flatnonzero(strengths.any(0))
    colors = lab.reshape(-1, 3)[known]
    totals = np.maximum(strengths.sum((1, 2)), 1e-12)
    # small objects count as much as large ones
    balanced = strengths.reshape(len(strengths), -1)[:, known] / totals[:, None]
    mixture = fit_mixture(colors, balanced.sum(0), random)
    responsibilities = mixture.responsibilities(mixture.log_components(colors)).astype(np.float32)
    return ColorModels(mixture, _local_shares(strengths, known, responsibilities))


def _local_shares(strengths: np.ndarray, known: np.ndarray, responsibilities: np.ndarray) -> np.ndarray:
    """Return local mixture weights [h', w', C, m]; responsibilities [n, m] are those of the pixels `known`."""
    n_classes, height, width = strengths.shape
    result = []
    for strength in strengths.reshape(n_classes, -1).astype(np.float32):
        whole = strength[known] @ responsibilities / max(strength.sum(), 1e-12)
        total = _windowed(strength.reshape(height, width))
        spread = np.zeros((height * width, responsibilities.shape[1]), np.float32)
        spread[known] = strength[known, None] * responsibilities
        local = np.stack([_windowed(plane.reshape(height, width)) for plane in spread.T], -1)
        result.append((local + GLOBAL_WEIGHT * whole) / (total + GLOBAL_WEIGHT)[..., None])
    return np.maximum(np.stack(result, 2), MIN_WEIGHT)


def _windowed(plane: np.ndarray) -> np.ndarray:
    """Average a plane [h, w] in a Gaussian window at every place of the coarse grid."""
    height, width = plane.shape
    size = (-(-width // STRIDE), -(-height // STRIDE))
    return cv2.GaussianBlur(cv2.resize(plane, size, interpolation=cv2.INTER_AREA), (0, 0), WINDOW / STRIDE)


def posterior(models: ColorModels, lab: np.ndarray, places: np.ndarray, priors: np.ndarray) -> np.ndarray:
    """Return posterior probabilities [C, n] float32 of colors [n, 3] at places [n, 2], as `log_densities`."""
    with np.errstate(divide="ignore"):
        logs = models.log_densities(lab, places).T + np.log(priors)
    odds = np.exp(logs - logs.max(0))
    return (odds / odds.sum(0)).astype(np.float32)
