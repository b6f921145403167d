"""Forward pass by ray: its path, samples in occupied cells, densities, ray weights, and the choice of colored samples.

A ray is terminated when its transmittance falls to DARK.
"""

import math

import numpy as np
from torch import Tensor

from ....compute.cores import parallel_for
from ....compute.kernels import allocating_kernel, kernel
from ...rendering.rays import Rays
from ...rendering.sampling import BLOCK
from ...rendering.space import CONTRACTION_VERTICES, FAR, Contraction, Space
from ...rendering.volume import VISIBLE_WEIGHT
from .. import renderer
from .arrays import HALF, ONE, THIRD, TWO, ZERO

CHUNK = 32  # rays with a common range of sample slots
DARK, FARTHEST = np.float32(renderer.DARK), np.float32(FAR)
MAX_STEPS = np.float32(1 << 20)  # per ray: three times the diagonal of the finest grid
VISIBLE = np.float32(VISIBLE_WEIGHT)  # least weight of a colored sample without Russian roulette


def paths_of(space: Space, bounds: Tensor, rays: Rays) -> np.ndarray:
    """Return `space.paths` within the grid's corners `bounds` [2, 3], [R, K, 3]."""
    if not isinstance(space, Contraction):  # whose knots take torch longer than the kernels need for the samples
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


@kernel
def polyline(path, starts, directions):
    """Write the arc lengths of the knots and the unit directions of the segments."""
    starts[0] = ZERO
    for k in range(len(path) - 1):
        x, y, z = path[k + 1, 0] - path[k, 0], path[k + 1, 1] - path[k, 1], path[k + 1, 2] - path[k, 2]
        length = math.sqrt(x * x + y * y + z * z)
        inverse = ONE / max(length, np.float32(1e-12))
        directions[k, 0], directions[k, 1], directions[k, 2] = x * inverse, y * inverse, z * inverse
        starts[k + 1] = starts[k] + length


@kernel
def distance_to(point, path, starts, directions, off_path):
    """Return the arc length of the path's point nearest to a point; -1 if it is not within off_path."""
    smallest, distance = off_path * off_path, np.float32(-1)
    for k in range(len(path) - 1):
        x, y, z = point[0] - path[k, 0], point[1] - path[k, 1], point[2] - path[k, 2]
        along = x * directions[k, 0] + y * directions[k, 1] + z * directions[k, 2]
        along = min(max(along, ZERO), starts[k + 1] - starts[k])
        x, y, z = x - along * directions[k, 0], y - along * directions[k, 1], z - along * directions[k, 2]
        gap = x * x + y * y + z * z
        if gap < smallest:
            smallest, distance = gap, starts[k] + along
    return distance


@kernel
def row_of(index, vertex):
    """Return the table row of a vertex with a row (see ../grid.py)."""
    entry = index[vertex >> 3]
    n_lower = entry & ((1 << (vertex & 7)) - 1)
    n_lower -= (n_lower >> 1) & 0x55
    n_lower = (n_lower & 0x33) + ((n_lower >> 2) & 0x33)
    return (entry >> 8) + ((n_lower + (n_lower >> 4)) & 0x0F)


@kernel
def corners_of(grid, vertex):
    """Return the table rows of the four lower corners of an occupied cell; each upper corner has the next row."""
    row, plane = grid.row_stride, grid.plane_stride
    return (
        row_of(grid.index, vertex), row_of(grid.index, vertex + row),
        row_of(grid.index, vertex + plane), row_of(grid.index, vertex + plane + row),
    )  # fmt: skip


@kernel
def raw_density(densities, corners, x, y, z):
    """Interpolate the raw density in a cell."""
    a = densities[corners[0]] + z * (densities[corners[0] + 1] - densities[corners[0]])
    b = densities[corners[1]] + z * (densities[corners[1] + 1] - densities[corners[1]])
    c = densities[corners[2]] + z * (densities[corners[2] + 1] - densities[corners[2]])
    d = densities[corners[3]] + z * (densities[corners[3] + 1] - densities[corners[3]])
    a += y * (b - a)
    c += y * (d - c)
    return a + x * (c - a)


@kernel
def point_on_path(path, starts, directions, segment, distance, grid):
    """Return the point at an arc length on a segment of a path, in cells from the grid's corner."""
    along, cells = distance - starts[segment], ONE / grid.voxel
    x = (path[segment, 0] + along * directions[segment, 0] - grid.minimum[0]) * cells
    y = (path[segment, 1] + along * directions[segment, 1] - grid.minimum[1]) * cells
    z = (path[segment, 2] + along * directions[segment, 2] - grid.minimum[2]) * cells
    return x, y, z


@allocating_kernel
def march(first_chunk, last_chunk, grid, rays, samples, settings):
    """Write `samples`, and `rays` except the color sums. A chunk with too few slots has a count equal to its capacity."""
    n_rays, n_knots = len(rays.jitter), rays.paths.shape[1]
    starts = np.empty(n_knots, np.float32)
    directions = np.empty((n_knots, 3), np.float32)
    for chunk in range(first_chunk, last_chunk):
        count = chunk * settings.capacity
        end = count + settings.capacity
        for ray in range(chunk * CHUNK, min(n_rays, (chunk + 1) * CHUNK)):
            polyline(rays.paths[ray], starts, directions)
            observation = ray - (n_rays - len(rays.observed))
            rays.reach[ray] = np.float32(-1)
            if observation >= 0:
                rays.reach[ray] = distance_to(
                    rays.observed[observation], rays.paths[ray], starts, directions, settings.off_path
                )
            rays.first[ray] = count
            count = march_ray(ray, count, end, starts, directions, grid, rays, samples, settings)
            rays.counts[ray] = count - rays.first[ray]
        samples.counts[chunk] = count - chunk * settings.capacity


@kernel
def march_ray(ray, count, end, starts, directions, grid, rays, samples, settings):
    """Write the samples of one ray from slot `count` on; return the slot after the last one. Non-finite rays have none."""
    path, jitter, reach, sums = rays.paths[ray], rays.jitter[ray], rays.reach[ray], rays.sums[ray]
    cells, blocks = grid.cells, grid.blocks
    step = settings.step * grid.voxel
    stride = np.float32(BLOCK) * step
    unit = ONE / settings.unit
    n_segments = len(path) - 1
    is_bent, length = n_segments > 1, starts[n_segments]
    transmittance, depth = ONE, ZERO
    weight_sum, distance_sum, square_sum, pairs, before, up_to, alpha_sum = ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO
    coarse_segment, segment, block = 0, 0, -1
    if not length < MAX_STEPS * step:  # or not finite: it would never end
        sums.final_transmittance = math.nan
        return count
    while transmittance > DARK:
        block += 1
        distance = (np.float32(block) + HALF) * stride
        if distance - HALF * stride >= length:
            break
        while coarse_segment + 1 < n_segments and starts[coarse_segment + 1] <= distance:
            coarse_segment += 1
        x, y, z = point_on_path(path, starts, directions, coarse_segment, distance, grid)
        i = min(max(int(x * np.float32(1 / BLOCK)), 0), blocks.x - 1)
        j = min(max(int(y * np.float32(1 / BLOCK)), 0), blocks.y - 1)
        k = min(max(int(z * np.float32(1 / BLOCK)), 0), blocks.z - 1)
        if grid.coarse[(i * blocks.y + j) * blocks.z + k] == 0:
            continue
        for number in range(block * BLOCK, (block + 1) * BLOCK):
            distance = (np.float32(number) + jitter) * step
            if distance >= length:
                break
            while segment + 1 < n_segments and starts[segment + 1] <= distance:
                segment += 1
            x, y, z = point_on_path(path, starts, directions, segment, distance, grid)
            # bent paths are not clipped to the grid
            if is_bent and (x < 0 or y < 0 or z < 0 or x >= cells.x or y >= cells.y or z >= cells.z):
                continue
            i = min(max(int(x), 0), cells.x - 1)
            j = min(max(int(y), 0), cells.y - 1)
            k = min(max(int(z), 0), cells.z - 1)
            if (grid.bits[(i * cells.y + j) * grid.row_bytes + (k >> 3)] >> (k & 7)) & 1 == 0:
                continue
            if count == end:
                return end  # the chunk is repeated with more slots
            x, y, z = x - np.float32(i), y - np.float32(j), z - np.float32(k)
            lowest = i * grid.plane_stride + j * grid.row_stride + k
            corners = corners_of(grid, lowest)
            raw = raw_density(grid.densities, corners, x, y, z) + grid.bias
            small = math.exp(-abs(raw))
            softplus = max(raw, ZERO) + (math.log(ONE + small) if small > np.float32(1e-4) or raw > ZERO else small)
            optical_depth = softplus * settings.step
            depth_gradient = (ONE if raw > ZERO else small) / (ONE + small)
            transparency = math.exp(-optical_depth)
            alpha = ONE - transparency
            if optical_depth < np.float32(1e-3):  # the difference would cancel
                alpha = optical_depth * (ONE - HALF * optical_depth)
            weight = transmittance * alpha
            scaled = distance * unit
            pairs += weight * (TWO * (scaled * weight_sum - distance_sum) + step * unit * THIRD * weight)
            weight_sum += weight
            distance_sum += weight * scaled
            square_sum += weight * scaled * scaled
            alpha_sum += alpha
            if reach >= ZERO:
                before += weight if distance < reach - settings.margin else ZERO
                up_to += weight if distance < reach + settings.margin else ZERO
            depth += optical_depth
            transmittance *= transparency
            samples.vertices[count] = lowest
            for corner in range(4):
                samples.corners[count, corner] = corners[corner]
            samples.rays[count] = ray
            point, light = samples.points[count], samples.light[count]
            point.x, point.y, point.z, point.distance = x, y, z, distance
            light.weight, light.transparency, light.transmittance = weight, transparency, transmittance
            light.depth_gradient = depth_gradient * settings.step
            samples.importances[count] = importance_of(weight, settings, ray, number)
            count += 1
            if transmittance <= DARK:
                break
    sums.final_transmittance, sums.distortion = math.exp(-depth), pairs
    sums.before, sums.up_to = before, up_to
    sums.distance, sums.square, sums.alpha = distance_sum, square_sum, alpha_sum
    return count


@kernel
def importance_of(weight, settings, ray, number):
    """Return 1 / p if a sample is drawn with its probability p (Russian roulette), else 0."""
    if settings.russian_roulette == ZERO:
        return ONE if weight > VISIBLE else ZERO
    if weight >= settings.russian_roulette:
        return ONE
    if uniform(settings.seed, ray, number) * settings.russian_roulette < weight:
        return settings.russian_roulette / weight
    return ZERO


@kernel
def uniform(seed, ray, number):
    """Return a pseudorandom number in [0, 1): an integer hash of the arguments (after Wellons, 2018)."""
    mask = np.uint64(0xFFFFFFFF)  # numba widens 32-bit products to 64 bits
    x = (np.uint64(seed) + np.uint64(ray) * np.uint64(0x9E3779B1) + np.uint64(number) * np.uint64(0x85EBCA77)) & mask
    for _ in range(2):  # one round leaves neighbors correlated
        x ^= x >> np.uint64(16)
        x = (x * np.uint64(0x7FEB352D)) & mask
        x ^= x >> np.uint64(15)
        x = (x * np.uint64(0x846CA68B)) & mask
        x ^= x >> np.uint64(16)
    return np.float32(x >> np.uint64(8)) * np.float32(1 / 16777216)


@kernel
def mark_visible(n_chunks, samples, capacity, visibility):
    """Raise `visibility`, by the row of each cell's lowest vertex, to the largest sample weight in the cell."""
    for chunk in range(n_chunks):
        for sample in range(chunk * capacity, chunk * capacity + samples.counts[chunk]):
            cell = samples.corners[sample, 0]
            visibility[cell] = max(visibility[cell], samples.light[sample].weight)
