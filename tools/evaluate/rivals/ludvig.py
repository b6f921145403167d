"""LUDVIG's graph diffusion: Marrie, Menegaux, Arbel, Larlus, Mairal, "LUDVIG: Learning-Free Uplifting of 2D Visual
Features to Gaussian Splatting Scenes", ICCV 2025.

The mask of the reference view is uplifted: the mean over the rays that end on a point, weighted as these are rendered.
From the points that are most of it, it diffuses on a graph of the k nearest points, `g_{t+1} = A g_t`, along edges
`A_ij = S(f_i, f_j) sqrt(P(f_i) P(f_j))`: a similarity of features, `S = exp(-|f_i - f_j|^2 / b)`, and a unary term P,
the logistic regression of the marked points' labels on their features. As in the authors' program an edge counts where
it is above a threshold, and what was reached is weighted by P.

Other than in the paper: surface points of our field instead of Gaussians; of features of DINOv2, whose weights are not
at hand, the field's prior features and the points' Lab colors stand in. These are less sure of what belongs together:
so k, which there is 200, is smaller, and the threshold is higher. These settings were chosen on two drawn scenes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from scipy import sparse

from karf_engine.compute.neighbors import build_kd_tree


@dataclass(frozen=True)
class Diffusion:
    """Settings of the diffusion.

    Attributes:
        neighbors: k.
        steps: T.
        seeds: Share of the marked points that it begins from, those most surely inside.
        edge: Weight above which an edge counts.
        ridge: Of the logistic regression, on standardized features.
        least: P above which a point that was reached is the object's.
    """

    neighbors: int = 16
    steps: int = 100
    seeds: float = 0.1
    edge: float = 0.2
    ridge: float = 0.01
    least: float = 0.5


def uplifted(inside: np.ndarray, weights: np.ndarray, point_of_sample: np.ndarray, n_points: int) -> np.ndarray:
    """The mean of a mask over the rays that end on each point, [p]; NaN where none of them is of a marked view.

    Args:
        inside: [n] in [0, 1], the mask at each ray.
        weights: [n] >= 0 of the rays, 0 in views without a mask.
        point_of_sample: [n, S] point of each sample of each ray.
        n_points: p.
    """
    n_samples = point_of_sample.shape[1]
    total = np.bincount(point_of_sample.ravel(), np.repeat(weights, n_samples), n_points)
    marked = np.bincount(point_of_sample.ravel(), np.repeat(weights * inside, n_samples), n_points)
    return np.divide(marked, total, out=np.full(n_points, np.nan), where=total > 0)


def diffused(
    positions: np.ndarray,
    features: np.ndarray,
    seeds: np.ndarray,
    settings: Diffusion = Diffusion(),
) -> np.ndarray:
    """Which points are of the object, bool [p].

    Args:
        positions: [p, 3].
        features: [p, F], standardized.
        seeds: [p], the uplifted mask; NaN where nothing is known.
        settings: Of the diffusion.
    """
    known = np.isfinite(seeds)
    unary = regressed(features[known], seeds[known], features, settings.ridge)
    root = sparse.diags(np.sqrt(unary))
    edges = (root @ similarities(positions, features, settings.neighbors) @ root) > settings.edge
    marked = np.nan_to_num(seeds)
    count = max(1, int(settings.seeds * (marked > 0).sum()))
    reached = marked >= max(np.sort(marked)[-count], np.finfo(float).tiny)
    for _ in range(settings.steps):
        reached = reached | (edges @ reached)
    return reached & (unary > settings.least)


def similarities(positions: np.ndarray, features: np.ndarray, neighbors: int) -> sparse.csr_matrix:
    """S of each point and its k nearest ones, symmetric [p, p]; b is the median of the squared distances."""
    count = min(neighbors + 1, len(positions))
    tree = build_kd_tree(positions, balanced_tree=False, compact_nodes=False)
    _, near = tree.query(positions, k=range(1, count + 1))
    apart = ((features[near] - features[:, None]) ** 2).sum(2)
    weights = np.exp(-apart / np.median(apart[:, 1:]))
    rows = np.repeat(np.arange(len(positions)), count)
    graph = sparse.csr_matrix((weights.ravel(), (rows, near.ravel())), shape=(len(positions),) * 2)
    return graph.maximum(graph.T)


def regressed(features: np.ndarray, labels: np.ndarray, wanted: np.ndarray, ridge: float) -> np.ndarray:
    """Probability [m] of wanted features [m, F] by logistic regression of labels [n] in [0, 1] on features [n, F].

    Both sides count as much, however many points each has.
    """
    x, y, asked = (torch.from_numpy(np.asarray(each, np.float64)) for each in (features, labels, wanted))
    balance = y / y.sum().clamp_min(1e-9) + (1 - y) / (1 - y).sum().clamp_min(1e-9)
    slope = torch.zeros(x.shape[1] + 1, dtype=torch.float64, requires_grad=True)
    optimizer = torch.optim.LBFGS([slope], max_iter=100, line_search_fn="strong_wolfe")

    def loss() -> torch.Tensor:
        optimizer.zero_grad()
        errors = torch.nn.functional.binary_cross_entropy_with_logits(x @ slope[1:] + slope[0], y, reduction="none")
        value = (balance * errors).sum() + ridge * (slope[1:] ** 2).sum()
        value.backward()
        return value

    optimizer.step(loss)
    return torch.sigmoid(asked @ slope[1:] + slope[0]).detach().numpy()
