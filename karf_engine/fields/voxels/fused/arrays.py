"""The arrays that kernels share, as named tuples: numba reads these without copies."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# bits of a row's flag: it has a gradient of its density, of its features
DENSITY, FEATURES, BOTH = np.uint8(1), np.uint8(2), np.uint8(3)
# columns of the sums of a ray
RED, REMAINDER, DISTORTION, BEFORE, UP_TO, DISTANCE, SQUARE, ALPHA, N_SUMS = 0, 3, 4, 5, 6, 7, 8, 9, 10


class Grid(NamedTuple):
    """The cells of a field.

    Attributes:
        minimum: [3], lowest corner, grid coordinates.
        voxel: Edge of a cell.
        shape: Cells along each axis, then blocks of `coarse` along each, then bytes of a row of `bits`, then numbers of
            vertices along z and along y and z, [9].
        bits: Occupied cells, eight a byte along the last axis, [X * Y * bytes].
        coarse: `sampling.coarse_occupancy`, [CX * CY * CZ].
        index: Which vertices have a table row (see ../vertices.py).
        densities: Raw density of each row: the field's own memory.
        bias: Raw density that stands for empty space.
    """

    minimum: np.ndarray
    voxel: np.float32
    shape: np.ndarray
    bits: np.ndarray
    coarse: np.ndarray
    index: np.ndarray
    densities: np.ndarray
    bias: np.float32


class Samples(NamedTuple):
    """Samples by ray, in chunks of rays that have `capacity` places each.

    Attributes:
        vertices: [S], the lowest vertex of each sample's cell.
        corners: Table rows of the cell's four lower corners, by x and then y, [S, 4]; the next row is the upper one's.
        rays: [S].
        places: Fractions along x, y, z within the cell, and distance along the ray, [S, 4].
        light: Ray weight, share of light that passes the sample, light behind it, and the derivative of its optical depth
            by the raw density, [S, 4]. The backward pass leaves the gradient of the raw density in the last column.
        shares: 0 for samples without a color; else what its color counts for, one over the probability of having one, [S].
        colors: sRGB, [S, 3]. The backward pass leaves the gradient of their logits.
        counts: Samples of each chunk.
    """

    vertices: np.ndarray
    corners: np.ndarray
    rays: np.ndarray
    places: np.ndarray
    light: np.ndarray
    shares: np.ndarray
    colors: np.ndarray
    counts: np.ndarray


def new_samples(n_chunks: int, capacity: int) -> Samples:
    """Places for the samples of so many chunks, not yet filled."""
    size = n_chunks * capacity
    return Samples(
        np.empty(size, np.int32),
        np.empty((size, 4), np.int32),
        np.empty(size, np.int32),
        np.empty((size, 4), np.float32),
        np.empty((size, 4), np.float32),
        np.empty(size, np.float32),
        np.empty((size, 3), np.float32),
        np.empty(n_chunks, np.int64),
    )


class Sorted(NamedTuple):
    """The same samples by their place in the grid: neighbors in memory are then read together.

    Attributes:
        index: [S], each one's place in `Samples`.
        corners: As in `Samples`, [S, 4].
        rays: [S].
        places: Fractions along x, y, z, and the share, [S, 4].
        features: [S, F].
        bins: Working space of the sort: for each core, samples of each part of a plane.
        planes: First sample of each plane of the grid, and their number, [X + 2].
    """

    index: np.ndarray
    corners: np.ndarray
    rays: np.ndarray
    places: np.ndarray
    features: np.ndarray
    bins: np.ndarray
    planes: np.ndarray


class RayArrays(NamedTuple):
    """What is known of each ray.

    Attributes:
        paths: Knots of its polyline, [R, K, 3].
        jitter: Offset of its samples, in steps, [R].
        observed: Points that the last O rays observe, [O, 3], grid coordinates.
        first: Its first sample, [R].
        counts: Its number of samples, [R].
        reach: Distance to its observed point; -1 where it observes none, or passes it by, [R].
        sums: What comes out, in the order of RED to ALPHA, [R, 10].
    """

    paths: np.ndarray
    jitter: np.ndarray
    observed: np.ndarray
    first: np.ndarray
    counts: np.ndarray
    reach: np.ndarray
    sums: np.ndarray


def new_rays(paths: np.ndarray, jitter: np.ndarray, observed: np.ndarray) -> RayArrays:
    """The arrays of these rays, of which nothing else is known yet."""
    n_rays = len(paths)
    return RayArrays(
        paths,
        jitter,
        observed,
        np.empty(n_rays, np.int64),
        np.empty(n_rays, np.int64),
        np.empty(n_rays, np.float32),
        np.zeros((n_rays, N_SUMS), np.float32),
    )


class Limits(NamedTuple):
    """Numbers of one batch.

    Attributes:
        capacity: Samples that a chunk of rays may have.
        seed: Of the lottery of colors.
        step: Distance between samples, voxels.
        lottery: Samples of less weight get a color with a probability in proportion to it; 0 for none.
        margin: How far before and behind an observed point its surface may lie, grid units.
        off_path: An observed point farther from its ray is a mistake, grid units.
        unit: Length in which distances are summed up, grid units.
    """

    capacity: int
    seed: int
    step: np.float32
    lottery: np.float32
    margin: np.float32
    off_path: np.float32
    unit: np.float32


class Network(NamedTuple):
    """The color network: w1 [F + 9, H], b1 [H], w2 [3, H], b2 [3]."""

    w1: np.ndarray
    b1: np.ndarray
    w2: np.ndarray
    b2: np.ndarray


class Table(NamedTuple):
    """A table with its gradients and Adam's moments, each [n * width]."""

    values: np.ndarray
    gradients: np.ndarray
    means: np.ndarray
    squares: np.ndarray
