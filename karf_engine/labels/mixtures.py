"""Gaussian mixtures of how a class looks: colors in CIE Lab, and which way its surface faces.

A component is a Gaussian of color times one of the unit normal, the latter with a floor: a class may well turn up
facing another way, so an unseen direction costs at most a fixed factor. Without normals a shaded light wall is lost to
whatever horizontal thing has its color; with Gaussian normals alone an object's unseen sides would be lost.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.cluster.vq import kmeans2

COLOR_FLOOR = 4.0  # added to variances of color, Lab units squared: no component collapses on one color
NORMAL_FLOOR = 0.04  # added to variances of the unit normal
NORMAL_SCALE = 10.0  # a unit of normal counts like this many units of Lab when components are formed
UNSEEN_DIRECTION = 0.01  # share of a component that faces anywhere
LOG_ANYWHERE = -np.log(4 * np.pi)


@dataclass(frozen=True)
class Gaussians:
    """means [m, 3] and covariances [m, 3, 3]."""

    means: np.ndarray
    covariances: np.ndarray

    def log_density(self, values: np.ndarray) -> np.ndarray:
        """Natural logarithm of each one's density at values [n, 3], [n, m]."""
        factors = np.linalg.cholesky(self.covariances)
        inverses = np.linalg.inv(factors)
        log_norms = np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(1) + 1.5 * np.log(2 * np.pi)
        parts = np.empty((len(values), len(self.means)))
        for number, (mean, inverse) in enumerate(zip(self.means, inverses, strict=True)):
            scaled = (values - mean) @ inverse.T
            parts[:, number] = -0.5 * np.einsum("ni,ni->n", scaled, scaled) - log_norms[number]
        return parts


@dataclass(frozen=True)
class Mixture:
    """shares [m] sum to 1; colors and normals: the components' Gaussians."""

    shares: np.ndarray
    colors: Gaussians
    normals: Gaussians

    def log_density(self, lab: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Natural logarithm of the density at Lab colors [n, 3] with unit normals [n, 3], [n]."""
        return _log_sum(self.log_parts(lab, normals))

    def log_parts(self, lab: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Logarithm of each component's share of the density, [n, m]."""
        facing = np.log1p(-UNSEEN_DIRECTION) + self.normals.log_density(normals)
        facing = np.logaddexp(facing, np.log(UNSEEN_DIRECTION) + LOG_ANYWHERE)
        return np.log(self.shares) + self.colors.log_density(lab) + facing


def fit_mixture(
    lab: np.ndarray,
    normals: np.ndarray,
    weights: np.ndarray,
    n_components: int,
    random: np.random.Generator,
    n_draws: int = 4000,
    iterations: int = 12,
) -> Mixture:
    """Fit by k-means and EM to `n_draws` points drawn in proportion to weights [n] (not all zero)."""
    drawn = random.choice(len(lab), n_draws, p=weights / weights.sum())
    lab, normals = lab[drawn], normals[drawn]
    together = np.concatenate([lab, NORMAL_SCALE * normals], 1)
    n_components = min(n_components, len(np.unique(drawn)))
    _, label = kmeans2(together, n_components, iter=4, minit="++", rng=random)
    mixture = _maximize(lab, normals, np.eye(n_components)[label])
    for _ in range(iterations):
        parts = mixture.log_parts(lab, normals)
        mixture = _maximize(lab, normals, np.exp(parts - _log_sum(parts)[:, None]))
    return mixture


def _maximize(lab: np.ndarray, normals: np.ndarray, responsibilities: np.ndarray) -> Mixture:
    counts = responsibilities.sum(0) + 1e-6
    return Mixture(
        counts / counts.sum(),
        _moments(lab, responsibilities, counts, COLOR_FLOOR),
        _moments(normals, responsibilities, counts, NORMAL_FLOOR),
    )


def _moments(values: np.ndarray, responsibilities: np.ndarray, counts: np.ndarray, floor: float) -> Gaussians:
    means = responsibilities.T @ values / counts[:, None]
    products = (values[:, :, None] * values[:, None, :]).reshape(len(values), 9)
    second = (responsibilities.T @ products).reshape(-1, 3, 3) / counts[:, None, None]
    covariances = second - means[:, :, None] * means[:, None, :]
    return Gaussians(means, covariances + floor * np.eye(3))


def _log_sum(parts: np.ndarray) -> np.ndarray:
    top = parts.max(1)
    return top + np.log(np.exp(parts - top[:, None]).sum(1))
