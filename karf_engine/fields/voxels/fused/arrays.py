"""Arrays of the kernels as named tuples, which numba reads without copies.

Sizes: R rays, K knots per ray, S sample slots, F features, H hidden units.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# flags of a table row: it has a gradient of its density, of its features
DENSITY, FEATURES, BOTH = np.uint8(1), np.uint8(2), np.uint8(3)
# columns of the sums of a ray
RED, GREEN, BLUE, FINAL_TRANSMITTANCE, DISTORTION, BEFORE, UP_TO, DISTANCE, SQUARE, ALPHA = range(10)
N_SUMS = 10


def _record(*names: str) -> np.dtype:
    """Return a record of float32, adjacent in memory."""
    return np.dtype((np.record, [(name, np.float32) for name in names]))


# fractions within the cell, and the distance along the ray
LOCAL_POINT = _record("x", "y", "z", "distance")
# of a sample: ray weight, 1 - alpha, transmittance after it, derivative of its optical depth by the raw density
LIGHT = _record("weight", "transparency", "transmittance", "depth_gradient")
# fractions within the cell, and the factor of the sample's color
SORTED_POINT = _record("x", "y", "z", "importance")


class Axes(NamedTuple):
    """One number per axis of the grid."""

    x: int
    y: int
    z: int


class Grid(NamedTuple):
    """Cells of a field."""

    minimum: np.ndarray  # [3], lowest corner, grid coordinates
    voxel: np.float32  # cell edge
    cells: Axes  # cells along each axis
    blocks: Axes  # blocks of `coarse` along each axis
    row_bytes: int  # bytes per row of `bits`
    row_stride: int  # increment of the vertex number along y
    plane_stride: int  # increment of the vertex number along x
    bits: np.ndarray  # occupied cells, eight per byte along z, [X * Y * row_bytes]
    coarse: np.ndarray  # `sampling.coarse_occupancy`, flat
    index: np.ndarray  # table row of each vertex (see ../vertices.py), flat
    densities: np.ndarray  # raw densities of the field, not copied
    bias: np.float32  # raw density of empty space


class Samples(NamedTuple):
    """Samples ordered by ray. Each chunk of rays has `capacity` slots."""

    vertices: np.ndarray  # [S], lowest vertex of the sample's cell
    corners: np.ndarray  # [S, 4], table rows of the cell's lower corners, by x and y; upper corners have the next row
    rays: np.ndarray  # [S]
    points: np.ndarray  # [S] of LOCAL_POINT
    light: np.ndarray  # [S] of LIGHT
    importances: np.ndarray  # [S], 1 / p for samples whose color is drawn with probability p; 0 without a color
    colors: np.ndarray  # [S, 3], sRGB
    counts: np.ndarray  # samples of each chunk


def new_samples(n_chunks: int, capacity: int) -> Samples:
    """Allocate samples, uninitialized."""
    size = n_chunks * capacity
    return Samples(
        np.empty(size, np.int32),
        np.empty((size, 4), np.int32),
        np.empty(size, np.int32),
        np.empty(size, LOCAL_POINT),
        np.empty(size, LIGHT),
        np.empty(size, np.float32),
        np.empty((size, 3), np.float32),
        np.empty(n_chunks, np.int64),
    )


class SampleGradients(NamedTuple):
    """Gradients of the loss, in the slots of `Samples`."""

    weights: np.ndarray  # [S], with respect to the ray weights
    densities: np.ndarray  # [S], with respect to the raw densities
    logits: np.ndarray  # [S, 3], with respect to the color logits, of colored samples; in the memory of the colors


class SortedSamples(NamedTuple):
    """Samples ordered by position in the grid, so that table accesses are local."""

    index: np.ndarray  # [S], slot in `Samples`
    corners: np.ndarray  # [S, 4], as in `Samples`
    rays: np.ndarray  # [S]
    points: np.ndarray  # [S] of SORTED_POINT
    features: np.ndarray  # [S, F]
    bins: np.ndarray  # [threads, bins], workspace of the counting sort; a bin is a part of a plane of the grid
    planes: np.ndarray  # [X + 2], first sample of each plane, and the number of samples


class RayArrays(NamedTuple):
    """Rays of a batch."""

    paths: np.ndarray  # [R, K, 3], knots of each polyline, grid coordinates
    jitter: np.ndarray  # [R], offset of the samples, steps
    observed: np.ndarray  # [O, 3], points observed by the last O rays, grid coordinates
    first: np.ndarray  # [R], first sample
    counts: np.ndarray  # [R], number of samples
    reach: np.ndarray  # [R], distance to the observed point; -1 without a valid observation
    sums: np.ndarray  # [R, N_SUMS], in the order of RED to ALPHA


def new_rays(paths: np.ndarray, jitter: np.ndarray, observed: np.ndarray) -> RayArrays:
    """Allocate the results of rays."""
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


class MarchSettings(NamedTuple):
    """Settings of one batch."""

    capacity: int  # sample slots per chunk of rays
    seed: int  # seed of the Russian roulette
    step: np.float32  # distance between samples, voxels
    russian_roulette: np.float32  # weight below which colors are drawn with a proportional probability; 0: off
    margin: np.float32  # largest distance between an observed point and its surface along the ray, grid units
    off_path: np.float32  # points farther than this from their own ray are ignored, grid units
    unit: np.float32  # unit of the summed distances, grid units


class Network(NamedTuple):
    """Color network: w1 [F + N_HARMONICS, H], b1 [H], w2 [3, H], b2 [3]."""

    w1: np.ndarray
    b1: np.ndarray
    w2: np.ndarray
    b2: np.ndarray


class Table(NamedTuple):
    """Flat parameter table with its gradients and Adam's moments."""

    values: np.ndarray
    gradients: np.ndarray
    means: np.ndarray
    squares: np.ndarray


class TablePair(NamedTuple):
    """Values or gradients of both tables: raw densities [n] and features [n * F]."""

    densities: np.ndarray
    features: np.ndarray


class Workspace(NamedTuple):
    """Memory of one thread for the gradients of GROUP samples at a time."""

    inputs: np.ndarray  # [GROUP, F + N_HARMONICS], of the color network
    feature_gradients: np.ndarray  # [GROUP, F]
    logit_gradients: np.ndarray  # [GROUP, 3]
    hidden: np.ndarray  # [GROUP, H], before the ReLU
    hidden_gradients: np.ndarray  # [GROUP, H]
    group: np.ndarray  # [GROUP], numbers of the sorted samples
