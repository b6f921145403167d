"""The arrays that kernels share, as named tuples: numba reads these without copies."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# bits of a row's flag: it has a gradient of its density, of its features
DENSITY, FEATURES, BOTH = np.uint8(1), np.uint8(2), np.uint8(3)
# columns of the sums of a ray, which torch differentiates as one tensor
RED, GREEN, BLUE, FINAL_TRANSMITTANCE, DISTORTION, BEFORE, UP_TO, DISTANCE, SQUARE, ALPHA = range(10)
N_SUMS = 10


def _record(*names: str) -> np.dtype:
    """Numbers of one sample that lie side by side in memory, by their names."""
    return np.dtype((np.record, [(name, np.float32) for name in names]))


PLACE = _record("x", "y", "z", "distance")
LIGHT = _record("weight", "transmittance", "behind", "slope")
SHARED_PLACE = _record("x", "y", "z", "share")


class Axes(NamedTuple):
    """A number for each axis of the grid."""

    x: int
    y: int
    z: int


class Grid(NamedTuple):
    """The cells of a field.

    Attributes:
        minimum: [3], lowest corner, grid coordinates.
        voxel: Edge of a cell.
        cells: Cells along each axis.
        blocks: Blocks of `coarse` along each axis.
        row_bytes: Bytes of a row of `bits`.
        row_stride: From a vertex's number to that of the next one along y.
        plane_stride: Likewise along x.
        bits: Occupied cells, eight a byte along the last axis, [X * Y * bytes].
        coarse: `sampling.coarse_occupancy`, [CX * CY * CZ].
        index: Which vertices have a table row (see ../vertices.py).
        densities: Raw density of each row: the field's own memory.
        bias: Raw density that stands for empty space.
    """

    minimum: np.ndarray
    voxel: np.float32
    cells: Axes
    blocks: Axes
    row_bytes: int
    row_stride: int
    plane_stride: int
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
        places: [S] of PLACE: fractions along x, y and z within the cell, and the distance along the ray.
        light: [S] of LIGHT: the ray weight, the share of light that passes the sample, the light behind it, and the slope
            of its optical depth by the raw density.
        shares: 0 for samples without a color; else what its color counts for, one over the probability of having one, [S].
        colors: sRGB, [S, 3].
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
    """Places for the samples of `n_chunks` chunks, not yet filled."""
    size = n_chunks * capacity
    return Samples(
        np.empty(size, np.int32),
        np.empty((size, 4), np.int32),
        np.empty(size, np.int32),
        np.empty(size, PLACE),
        np.empty(size, LIGHT),
        np.empty(size, np.float32),
        np.empty((size, 3), np.float32),
        np.empty(n_chunks, np.int64),
    )


class SampleGradients(NamedTuple):
    """Gradients of the loss by what the samples contribute, at the same places as `Samples`.

    Attributes:
        weights: By their ray weights, [S].
        densities: By their raw densities, [S].
        logits: By the logits of their colors, [S, 3]; only of samples with a color. It is the memory of the colors, which
            nothing reads after them.
    """

    weights: np.ndarray
    densities: np.ndarray
    logits: np.ndarray


def new_sample_gradients(samples: Samples) -> SampleGradients:
    """Places for the gradients of these samples, not yet filled."""
    size = len(samples.rays)
    return SampleGradients(np.empty(size, np.float32), np.empty(size, np.float32), samples.colors)


class Sorted(NamedTuple):
    """The same samples by their place in the grid: neighbors in memory are then read together.

    Attributes:
        index: [S], each one's place in `Samples`.
        corners: As in `Samples`, [S, 4].
        rays: [S].
        places: [S] of SHARED_PLACE: fractions along x, y and z within the cell, and the share.
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
        sums: What comes out, in the order of RED to ALPHA, [R, N_SUMS].
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
        seed: Of the Russian roulette for colors.
        step: Distance between samples, voxels.
        russian_roulette: Samples of less weight get a color with a probability in proportion to it; 0 for none.
        margin: How far before and behind an observed point its surface may lie, grid units.
        off_path: An observed point farther from its ray is a mistake, grid units.
        unit: Length in which distances are summed up, grid units.
    """

    capacity: int
    seed: int
    step: np.float32
    russian_roulette: np.float32
    margin: np.float32
    off_path: np.float32
    unit: np.float32


class Network(NamedTuple):
    """The color network: w1 [F + N_HARMONICS, H], b1 [H], w2 [3, H], b2 [3]."""

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


class TablePair(NamedTuple):
    """Values or gradients of both tables: raw densities [n] and features [n * F]."""

    densities: np.ndarray
    features: np.ndarray


class Workspace(NamedTuple):
    """Memory in which one thread computes the gradients of GROUP samples at a time.

    Attributes:
        inputs: Of the color network, [GROUP, F + N_HARMONICS].
        feature_gradients: [GROUP, F].
        logit_gradients: [GROUP, 3].
        hidden: Before the ReLU, [GROUP, H].
        hidden_gradients: [GROUP, H].
        group: The samples' numbers in the order of places, [GROUP].
    """

    inputs: np.ndarray
    feature_gradients: np.ndarray
    logit_gradients: np.ndarray
    hidden: np.ndarray
    hidden_gradients: np.ndarray
    group: np.ndarray
