"""Soft labels of pixels from a prior for each and from its neighbors of like color.

Random walks with priors (Grady, "Multilabel Random Walker Image Segmentation Using Prior Models", 2005): the labels
x_c of class c minimize sum_ij w_ij (x_ci - x_cj)^2 + sum_i g_i (x_ci - p_ci)^2, where p is a pixel's prior, g the
prior's weight, and w_ij is high between neighbors of like color. It is one sparse, positive definite system for all
classes, and its solution sums to 1 where the priors do.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from scipy import sparse

from ..compute.sparse_systems import solve

LIKENESS = 0.05  # per squared Lab unit: neighbors that differ by 4.5 are linked by exp(-1) (not varied on record)
LEAST_LINK = 1e-4  # between neighbors of any colors: the system stays definite (not varied on record)
NEIGHBORS = ((0, 1), (1, 0), (1, 1), (1, -1))  # row and column to half of the eight neighbors

Part = tuple[slice, slice]  # of a picture
Link = tuple[Part, Part, np.ndarray]  # pixels, their neighbors in one direction, and what links each two, > 0


def links_of(channels: np.ndarray, likeness: float = LIKENESS) -> Iterator[Link]:
    """How neighbors are linked: half of the eight directions, one after the other.

    Args:
        channels: [h, w, C] float32, of which the squared differences count alike; CIE Lab, for example.
        likeness: Per squared unit: neighbors that differ by d are linked by exp(-likeness d^2).
    """
    for down, right in NEIGHBORS:
        here, there = _shifted(channels.shape[:2], down, right)
        yield here, there, np.exp(-likeness * ((channels[here] - channels[there]) ** 2).sum(-1)) + LEAST_LINK


def random_walk(
    links: Iterable[Link], priors: np.ndarray, free: np.ndarray, prior_weight: float | np.ndarray
) -> np.ndarray:
    """Labels of the free pixels; those of the others are their priors.

    Args:
        links: Between the pixels, see `links_of`.
        priors: [C, h, w] float32, sum to 1 over C.
        free: [h, w] bool.
        prior_weight: What a pixel's prior counts beside its links to neighbors, > 0; a number or [n] of the free
            pixels.

    Returns:
        [C, n] float32 of the n free pixels, in [0, 1].
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
            rows.append(own[inside]), columns.append(other[inside]), values.append(-link[inside])
            for right_hand_side, prior in zip(right_hand_sides, priors, strict=True):
                right_hand_side += np.bincount(own[edge], link[edge] * prior[place][edge], count)
    diagonal = degree + prior_weight
    links = sparse.csr_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), (count, count))
    system = links + sparse.diags_array(diagonal)
    solved = [
        solve(system, right_hand_side + prior_weight * prior, prior)
        for right_hand_side, prior in zip(right_hand_sides, priors[:, free].astype(np.float64), strict=True)
    ]
    return np.clip(np.stack(solved), 0, 1).astype(np.float32)


def _shifted(shape: tuple[int, int], down: int, right: int) -> tuple[Part, Part]:
    """Slices of all pixels that have a neighbor in that direction, and of these neighbors."""
    height, width = shape
    here = slice(0, height - down), slice(max(0, -right), width - max(0, right))
    return here, (slice(down, height), slice(max(0, right), width + min(0, right)))
