"""Random walker segmentation with priors: soft labels of pixels from priors and from neighbors of similar color.

The labels x_c of class c minimize sum_ij w_ij (x_ci - x_cj)^2 + sum_i g_i (x_ci - p_ci)^2, where p is a pixel's prior,
g its weight, and w_ij is high between neighbors of similar color (Grady, "Multilabel Random Walker Image Segmentation
Using Prior Models", 2005). It is one sparse, positive definite system for all classes; x sums to 1 where the priors do.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from scipy import sparse

from ..compute.sparse_systems import solve

Region = tuple[slice, slice]  # rows and columns
Link = tuple[Region, Region, np.ndarray]  # pixels, their neighbors in one direction, and the weights w > 0


def neighbor_links(channels: np.ndarray, falloff: float = 0.05) -> Iterator[Link]:
    """Yield the links to half of the eight neighbors, one direction at a time.

    channels: [h, w, C] float32, such as CIE Lab. falloff: neighbors at distance d have the weight exp(-falloff d^2).
    """
    height, width = channels.shape[:2]
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        here = slice(0, height - down), slice(max(0, -right), width - max(0, right))
        there = slice(down, height), slice(max(0, right), width + min(0, right))
        # the constant keeps the system definite
        yield here, there, np.exp(-falloff * ((channels[here] - channels[there]) ** 2).sum(-1)) + 1e-4


def random_walk(
    links: Iterable[Link], priors: np.ndarray, free: np.ndarray, prior_weight: float | np.ndarray
) -> np.ndarray:
    """Return the labels of the n free pixels, [C, n] float32 in [0, 1]; all other pixels keep their priors.

    priors: [C, h, w] float32, sum to 1 over C. free: [h, w] bool. prior_weight: g > 0, a number or [n].
    """
    count = int(free.sum())
    number = np.full(free.shape, -1, np.int32)
    number[free] = np.arange(count, dtype=np.int32)
    degree, right_hand_sides = np.zeros(count), np.zeros((len(priors), count))
    rows, columns, values = [], [], []
    for here, there, link in links:
        for own, other, place in ((number[here], number[there], there), (number[there], number[here], here)):
            inside, edge = (own >= 0) & (other >= 0), (own >= 0) & (other < 0)
            degree += np.bincount(own[own >= 0], link[own >= 0], count)
            rows.append(own[inside])
            columns.append(other[inside])
            values.append(-link[inside])
            for right_hand_side, prior in zip(right_hand_sides, priors, strict=True):
                right_hand_side += np.bincount(own[edge], link[edge] * prior[place][edge], count)
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    system = sparse.csr_array(entries, (count, count)) + sparse.diags_array(degree + prior_weight)
    solved = [
        solve(system, right_hand_side + prior_weight * prior, prior)
        for right_hand_side, prior in zip(right_hand_sides, priors[:, free].astype(np.float64), strict=True)
    ]
    return np.clip(np.stack(solved), 0, 1).astype(np.float32)
