"""Rays as polylines in the grid. Torch takes longer for the contraction's knots than the kernels for the samples."""

from __future__ import annotations

import math

import numpy as np
from torch import Tensor

from ....compute.cores import parallel_for
from ....compute.kernels import kernel
from ...rendering.rays import Rays
from ...rendering.space import CONTRACTION_VERTICES, FAR, Contraction, Space
from .marching import ONE, TWO

FARTHEST = np.float32(FAR)


def paths_of(space: Space, bounds: Tensor, rays: Rays) -> np.ndarray:
    """Return `space.paths` within the grid's corners `bounds` [2, 3], [R, K, 3]."""
    if not isinstance(space, Contraction):
        return space.paths(rays, *bounds).contiguous().numpy()
    paths = np.empty((len(rays), CONTRACTION_VERTICES, 3), np.float32)
    origins, viewdirs = rays.origins.contiguous().numpy(), rays.viewdirs.contiguous().numpy()
    lengths = map(np.float32, (space.radius, space.room, space.near))
    parallel_for(contracted_paths, len(rays), origins, viewdirs, space.center.numpy(), *lengths, paths)
    return paths


@kernel
def contracted_paths(first, last, origins, viewdirs, center, radius, room, near, paths):
    """Write the knots of rays first to last in a contraction (see space.Contraction.paths)."""
    n_knots = paths.shape[1]
    to_unit = ONE / radius
    for ray in range(first, last):
        dx, dy, dz = viewdirs[ray, 0], viewdirs[ray, 1], viewdirs[ray, 2]
        x, y, z = origins[ray, 0] - center[0], origins[ray, 1] - center[1], origins[ray, 2] - center[2]
        closest = -(x * dx + y * dy + z * dz)
        start = (near - closest) / (TWO * radius)
        start = FARTHEST * start / (ONE + abs(start))
        for knot in range(n_knots):
            u = start + np.float32(knot) / np.float32(n_knots - 1) * (ONE - start)
            t = closest + TWO * radius * u / (FARTHEST - abs(u))
            a, b, c = (x + t * dx) * to_unit, (y + t * dy) * to_unit, (z + t * dz) * to_unit
            norm = max(math.sqrt(a * a + b * b + c * c), ONE)
            scale = (ONE + room - room / norm) / norm
            paths[ray, knot, 0], paths[ray, knot, 1], paths[ray, knot, 2] = a * scale, b * scale, c * scale
