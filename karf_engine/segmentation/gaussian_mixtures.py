"""Gaussian mixtures in CIE Lab: the color densities of the classes.

All classes share one set of Gaussians, with different weights. A separate mixture for each class would describe a few
mislabelled colors more finely than the class that they belong to, and so win them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.cluster.vq import kmeans2

VARIANCE_FLOOR = 4.0  # Lab units squared: keeps a component from collapsing on one color
EM_STEPS = 12
N_COMPONENTS = 20
N_DRAWS = 5000  # colors that a mixture is fitted to


@dataclass(frozen=True)
class Mixture:
    """A mixture of m Gaussians."""

    shares: np.ndarray  # [m], sum to 1
    means: np.ndarray  # [m, 3] CIE Lab
    covariances: np.ndarray  # [m, 3, 3]

    def log_components(self, lab: np.ndarray) -> np.ndarray:
        """Return the log density of each Gaussian at colors [n, 3], [n, m]."""
        factors = np.linalg.cholesky(self.covariances)
        inverses = np.linalg.inv(factors)
        log_norms = np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(1) + 1.5 * np.log(2 * np.pi)
        parts = np.empty((len(lab), len(self.means)))
        for number, (mean, inverse) in enumerate(zip(self.means, inverses, strict=True)):
            scaled = (lab - mean) @ inverse.T
            parts[:, number] = -0.5 * np.einsum("ni,ni->n", scaled, scaled) - log_norms[number]
        return parts

    def responsibilities(self, log_components: np.ndarray) -> np.ndarray:
        """Return the posterior of each component, [n, m]; rows sum to 1."""
        parts = log_components + np.log(self.shares)
        return np.exp(parts - _log_sum_exp(parts)[:, None])


def class_log_densities(lab: np.ndarray, strengths: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the log density of each class at the colors of n points, [n, C].

    strengths: [n, C] >= 0, evidence of each point for each class; not all zero.
    """
    balanced = strengths / np.maximum(strengths.sum(0), 1e-12)  # small objects count as much as large ones
    mixture = fit_mixture(lab, balanced.sum(1), random)
    log_components = mixture.log_components(lab)
    shares = balanced.T @ mixture.responsibilities(log_components)
    return np.stack([_log_sum_exp(log_components + np.log(np.maximum(own, 1e-9))) for own in shares], 1)


def fit_mixture(lab: np.ndarray, weights: np.ndarray, random: np.random.Generator) -> Mixture:
    """Fit a mixture by k-means and EM to colors [n, 3], drawn with weights [n] >= 0, not all zero."""
    lab = lab[random.choice(len(lab), N_DRAWS, p=weights / weights.sum())]
    n_components = min(N_COMPONENTS, len(np.unique(lab, axis=0)))  # an object may have one color only
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
    covariances = second - means[:, :, None] * means[:, None, :] + VARIANCE_FLOOR * np.eye(3)
    return Mixture(counts / counts.sum(), means, covariances)


def _log_sum_exp(parts: np.ndarray) -> np.ndarray:
    top = parts.max(1)
    return top + np.log(np.exp(parts - top[:, None]).sum(1))
