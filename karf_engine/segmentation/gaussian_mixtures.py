"""Gaussian mixtures in CIE Lab: which colors the classes have.

All classes share one set of Gaussians, and a class is its shares of them. With a set of its own, a class that holds few
colors by mistake (a chunk of the object that the hand left out) would describe them more finely than the class they
belong to, and so win them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.cluster.vq import kmeans2

COLOR_FLOOR = 4.0  # added to variances, Lab units squared: no component collapses on one color
COMPONENTS, DRAWS = 20, 5000
EM_STEPS = 12
LEAST_SHARE = 1e-9


@dataclass(frozen=True)
class Mixture:
    """A mixture of m Gaussians.

    Attributes:
        shares: [m], sum to 1.
        means: [m, 3] CIE Lab.
        covariances: [m, 3, 3].
    """

    shares: np.ndarray
    means: np.ndarray
    covariances: np.ndarray

    def log_components(self, lab: np.ndarray) -> np.ndarray:
        """Natural logarithm of each Gaussian's density at colors [n, 3], [n, m]."""
        factors = np.linalg.cholesky(self.covariances)
        inverses = np.linalg.inv(factors)
        log_norms = np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(1) + 1.5 * np.log(2 * np.pi)
        parts = np.empty((len(lab), len(self.means)))
        for number, (mean, inverse) in enumerate(zip(self.means, inverses, strict=True)):
            scaled = (lab - mean) @ inverse.T
            parts[:, number] = -0.5 * np.einsum("ni,ni->n", scaled, scaled) - log_norms[number]
        return parts

    def responsibilities(self, log_components: np.ndarray) -> np.ndarray:
        """How far each component explains each color, [n, m]; rows sum to 1."""
        parts = log_components + np.log(self.shares)
        return np.exp(parts - _log_sum(parts)[:, None])


def class_log_densities(lab: np.ndarray, strengths: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Natural logarithm of each class's density at the colors of n points.

    Args:
        lab: [n, 3] CIE Lab.
        strengths: [n, C] >= 0, how far a point stands for a class; not all zero. A class without any is nowhere dense.
        random: draws the points that the mixture is fitted to.

    Returns:
        [n, C].
    """
    even = strengths / np.maximum(strengths.sum(0), 1e-12)  # small objects count as much as large ones
    mixture = fit_mixture(lab, even.sum(1), COMPONENTS, random, DRAWS)
    log_components = mixture.log_components(lab)
    shares = even.T @ mixture.responsibilities(log_components)
    return np.stack([_log_sum(log_components + np.log(np.maximum(own, LEAST_SHARE))) for own in shares], 1)


def fit_mixture(
    lab: np.ndarray, weights: np.ndarray, n_components: int, random: np.random.Generator, n_draws: int = 4000
) -> Mixture:
    """Fit a mixture by k-means and EM to points that are drawn.

    Args:
        lab: [n, 3] CIE Lab.
        weights: [n] >= 0, the points' chances to be drawn; not all zero.
        n_components: m; fewer where there are fewer colors.
        random: draws.
        n_draws: number of points.
    """
    drawn = random.choice(len(lab), n_draws, p=weights / weights.sum())
    lab = lab[drawn]
    n_components = min(n_components, len(np.unique(lab, axis=0)))  # an object may be all of one color
    _, label = kmeans2(lab, n_components, iter=4, minit="++", rng=random)
    mixture = _maximize(lab, np.eye(n_components)[label])
    for _ in range(EM_STEPS):
        mixture = _maximize(lab, mixture.responsibilities(mixture.log_components(lab)))
    return mixture


def _maximize(lab: np.ndarray, responsibilities: np.ndarray) -> Mixture:
    counts = responsibilities.sum(0) + 1e-6
    means = responsibilities.T @ lab / counts[:, None]
    products = (lab[:, :, None] * lab[:, None, :]).reshape(len(lab), 9)
    second = (responsibilities.T @ products).reshape(-1, 3, 3) / counts[:, None, None]
    covariances = second - means[:, :, None] * means[:, None, :] + COLOR_FLOOR * np.eye(3)
    return Mixture(counts / counts.sum(), means, covariances)


def _log_sum(parts: np.ndarray) -> np.ndarray:
    top = parts.max(1)
    return top + np.log(np.exp(parts - top[:, None]).sum(1))
