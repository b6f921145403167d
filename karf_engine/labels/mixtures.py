"""Gaussian mixtures of weighted colors: how likely a color is in a class."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.cluster.vq import kmeans2


@dataclass(frozen=True)
class Mixture:
    """shares [m] sum to 1, means [m, 3], covariances [m, 3, 3]."""

    shares: np.ndarray
    means: np.ndarray
    covariances: np.ndarray

    def log_density(self, values: np.ndarray) -> np.ndarray:
        """Natural logarithm of the density at values [n, 3], [n]."""
        return _log_sum(self._log_parts(values))

    def _log_parts(self, values: np.ndarray) -> np.ndarray:
        parts = np.empty((len(values), len(self.shares)))
        for number, (share, mean, covariance) in enumerate(
            zip(self.shares, self.means, self.covariances, strict=True)
        ):
            factor = np.linalg.cholesky(covariance)
            scaled = np.linalg.solve(factor, (values - mean).T)
            log_norm = np.log(np.diag(factor)).sum() + 0.5 * len(mean) * np.log(2 * np.pi)
            parts[:, number] = np.log(share) - log_norm - 0.5 * (scaled**2).sum(0)
        return parts


def fit_mixture(
    values: np.ndarray,
    weights: np.ndarray,
    n_components: int,
    random: np.random.Generator,
    n_draws: int = 4000,
    iterations: int = 12,
    floor: float = 4.0,
) -> Mixture:
    """Fit by k-means and EM to `n_draws` values [n, 3] drawn in proportion to weights [n] (not all zero).

    floor: added to every variance (units of the values squared), so that a component cannot collapse on one color.
    """
    drawn = values[random.choice(len(values), n_draws, p=weights / weights.sum())]
    n_components = min(n_components, len(np.unique(drawn, axis=0)))
    _, label = kmeans2(drawn, n_components, iter=4, minit="++", rng=random)
    responsibilities = np.eye(n_components)[label]
    mixture = _maximize(drawn, responsibilities, floor)
    for _ in range(iterations):
        parts = mixture._log_parts(drawn)
        mixture = _maximize(drawn, np.exp(parts - _log_sum(parts)[:, None]), floor)
    return mixture


def _maximize(values: np.ndarray, responsibilities: np.ndarray, floor: float) -> Mixture:
    counts = responsibilities.sum(0) + 1e-6
    means = responsibilities.T @ values / counts[:, None]
    centered = values[:, None] - means  # [n, m, 3]
    covariances = np.einsum("nm,nmi,nmj->mij", responsibilities, centered, centered) / counts[:, None, None]
    return Mixture(counts / counts.sum(), means, covariances + floor * np.eye(values.shape[1]))


def _log_sum(parts: np.ndarray) -> np.ndarray:
    top = parts.max(1)
    return top + np.log(np.exp(parts - top[:, None]).sum(1))
