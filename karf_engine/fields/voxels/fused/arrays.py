"""Arrays of the kernels as named tuples, which numba reads without copies, and the instruction that prefetches them.

Sizes: R rays, K knots per ray, S sample slots, F features, H hidden units.
"""

from typing import Any, NamedTuple

import numba
import numpy as np
import torch
from llvmlite import ir
from numba.extending import intrinsic
from torch import Tensor

from ..grid import VoxelGrid

ZERO, HALF, ONE, TWO, THIRD = map(np.float32, (0, 0.5, 1, 2, 1 / 3))
# flags of a table row: it has a gradient of its density, of its features
DENSITY, FEATURES, BOTH = np.uint8(1), np.uint8(2), np.uint8(3)


def _record(*names: str) -> np.dtype:
    """Return a record of float32, adjacent in memory."""
    return np.dtype((np.record, [(name, np.float32) for name in names]))


# fractions within the cell, and the distance along the ray
LOCAL_POINT = _record("x", "y", "z", "distance")
# of a sample: ray weight, 1 - alpha, transmittance after it, derivative of its optical depth by the raw density
LIGHT = _record("weight", "transparency", "transmittance", "depth_gradient")
# fractions within the cell, and the factor of the sample's color
SORTED_POINT = _record("x", "y", "z", "importance")
# sums along a ray, as in `RaySums`; the first three are its color
SUMS = _record(
    "red", "green", "blue", "final_transmittance", "distortion", "before", "up_to", "distance", "square", "alpha"
)


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
    index: np.ndarray  # table row of each vertex (see ../grid.py), flat
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
    colors: np.ndarray  # [S, 3], sRGB; in the backward pass gradients of the loss with respect to their logits
    weight_gradients: np.ndarray  # [S], gradients of the loss with respect to the ray weights
    density_gradients: np.ndarray  # [S], and to the raw densities
    counts: np.ndarray  # samples of each chunk


def new_samples(n_chunks: int, capacity: int) -> Samples:
    """Allocate samples, uninitialized."""
    size, f32, i32 = n_chunks * capacity, np.float32, np.int32
    vertices, corners, rays = np.empty(size, i32), np.empty((size, 4), i32), np.empty(size, i32)
    points, light = np.empty(size, LOCAL_POINT), np.empty(size, LIGHT)
    importances, colors = np.empty(size, f32), np.empty((size, 3), f32)
    gradients, counts = (np.empty(size, f32), np.empty(size, f32)), np.empty(n_chunks, np.int64)
    return Samples(vertices, corners, rays, points, light, importances, colors, *gradients, counts)


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
    sums: np.ndarray  # [R] of SUMS


def new_rays(paths: np.ndarray, jitter: np.ndarray, observed: np.ndarray) -> RayArrays:
    """Allocate the results of rays."""
    n = len(paths)
    first, counts, reach = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n, np.float32)
    return RayArrays(paths, jitter, observed, first, counts, reach, np.zeros(n, SUMS))


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


def grid_of(field: VoxelGrid) -> Grid:
    """Return the cells of a field, with its densities."""
    bits = np.packbits(field.occupied.numpy(), axis=2, bitorder="little")
    row_stride, plane_stride = field.vertex_numbers(torch.tensor([[0, 1, 0], [1, 0, 0]])).tolist()
    minimum, voxel, bias = field.minimum.numpy(), np.float32(field.voxel), np.float32(field.density_bias)
    cells, blocks, coarse = Axes(*field.occupied.shape), Axes(*field.coarse.shape), field.coarse.numpy().view(np.uint8)
    steps, index = (bits.shape[2], row_stride, plane_stride), field.index.view(-1).numpy()
    return Grid(
        minimum, voxel, cells, blocks, *steps, bits.ravel(), coarse.ravel(), index, flat(field.raw_density), bias
    )


def network_of(field: VoxelGrid) -> Network:
    """Return the color network with a transposed copy of its first layer's weights."""
    w1, b1, w2, b2 = (part.detach().numpy() for layer in field.color_layers for part in (layer.weight, layer.bias))
    return Network(np.ascontiguousarray(w1.T), b1, w2, b2)


def flat(tensor: Tensor) -> np.ndarray:
    """Return a flat view of a tensor's memory."""
    return tensor.detach().numpy().reshape(-1)


@intrinsic  # pyright: ignore[reportArgumentType]
def _prefetch(typing_context: Any, array: Any, index: Any) -> Any:
    del typing_context

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        address = builder.bitcast(builder.gep(data, [arguments[1]]), ir.IntType(8).as_pointer())
        number = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [address.type, number, number, number])
        function = builder.module.declare_intrinsic("llvm.prefetch", [address.type], kind)
        builder.call(function, [address, number(0), number(3), number(1)])  # read, highest locality, data cache
        return context.get_dummy_value()

    return numba.types.none(array, index), generate


def _no_operation(array: Any, index: Any) -> None:
    """Replace the instruction in plain Python."""


# prefetch(array, index) loads an element into the cache; any index is valid
prefetch: Any = _no_operation if numba.config.DISABLE_JIT else _prefetch  # pyright: ignore
