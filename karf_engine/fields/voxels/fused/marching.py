"""Forward, ray by ray: samples in occupied cells, their density, how much light is left, and which get a color.

A ray stops where the light is used up: what lies behind cannot be seen and is not computed.
"""

from __future__ import annotations

import math

import numpy as np

from ....compute.kernels import allocating_kernel, kernel
from ...rendering.sampling import BLOCK
from ...rendering.volume import VISIBLE_WEIGHT
from .. import renderer
from .arrays import (
    ALPHA,
    BEFORE,
    DISTANCE,
    DISTORTION,
    FINAL_TRANSMITTANCE,
    SQUARE,
    UP_TO,
    Grid,
    Limits,
    RayArrays,
    Samples,
)

CHUNK = 32  # rays whose samples lie in one piece of memory
DARK = np.float32(renderer.DARK)
MOST_STEPS = np.float32(1 << 20)  # of a ray: the finest grid's diagonal has a third of that
VISIBLE = np.float32(VISIBLE_WEIGHT)  # without Russian roulette, samples of less weight have no color
ZERO, HALF, ONE, TWO = np.float32(0), np.float32(0.5), np.float32(1), np.float32(2)
THIRD = np.float32(1 / 3)


@kernel
def uniform(seed, ray, number):
    """A number in [0, 1) that only depends on these three (a mix of their bits after Wellons, 2018)."""
    mask = np.uint64(0xFFFFFFFF)  # products of 32 bits are widened to 64: every step is cut again
    x = (np.uint64(seed) + np.uint64(ray) * np.uint64(0x9E3779B1) + np.uint64(number) * np.uint64(0x85EBCA77)) & mask
    for _ in range(2):  # neighbors in ray and number need both rounds
        x ^= x >> np.uint64(16)
        x = (x * np.uint64(0x7FEB352D)) & mask
        x ^= x >> np.uint64(15)
        x = (x * np.uint64(0x846CA68B)) & mask
        x ^= x >> np.uint64(16)
    return np.float32(x >> np.uint64(8)) * np.float32(1 / 16777216)


@kernel
def polyline(path, starts, directions):
    """Distances travelled at the knots, and the directions of the pieces between them."""
    starts[0] = ZERO
    for k in range(len(path) - 1):
        x, y, z = path[k + 1, 0] - path[k, 0], path[k + 1, 1] - path[k, 1], path[k + 1, 2] - path[k, 2]
        length = math.sqrt(x * x + y * y + z * z)
        inverse = ONE / max(length, np.float32(1e-12))
        directions[k, 0], directions[k, 1], directions[k, 2] = x * inverse, y * inverse, z * inverse
        starts[k + 1] = starts[k] + length


@kernel
def distance_to(point, path, starts, directions, off_path):
    """Distance travelled until the path is nearest to a point; -1 if it passes it by."""
    smallest, at = off_path * off_path, np.float32(-1)
    for k in range(len(path) - 1):
        x, y, z = point[0] - path[k, 0], point[1] - path[k, 1], point[2] - path[k, 2]
        along = x * directions[k, 0] + y * directions[k, 1] + z * directions[k, 2]
        along = min(max(along, ZERO), starts[k + 1] - starts[k])
        x, y, z = x - along * directions[k, 0], y - along * directions[k, 1], z - along * directions[k, 2]
        gap = x * x + y * y + z * z
        if gap < smallest:
            smallest, at = gap, starts[k] + along
    return at


@kernel
def row_of(index, vertex):
    """Table row of a vertex that has one: the rows before its eight, and those of lower bits than its own."""
    entry = index[vertex >> 3]
    below = entry & ((1 << (vertex & 7)) - 1)
    below -= (below >> 1) & 0x55
    below = (below & 0x33) + ((below >> 2) & 0x33)
    return (entry >> 8) + ((below + (below >> 4)) & 0x0F)


@kernel
def corners_of(grid, vertex):
    """Table rows of the four lower corners of the occupied cell at a vertex; each has the upper one's after it."""
    row, plane = grid.row_stride, grid.plane_stride
    return (
        row_of(grid.index, vertex), row_of(grid.index, vertex + row),
        row_of(grid.index, vertex + plane), row_of(grid.index, vertex + plane + row),
    )  # fmt: skip


@kernel
def raw_density(densities, corners, x, y, z):
    """Trilinear in a cell."""
    a = densities[corners[0]] + z * (densities[corners[0] + 1] - densities[corners[0]])
    b = densities[corners[1]] + z * (densities[corners[1] + 1] - densities[corners[1]])
    c = densities[corners[2]] + z * (densities[corners[2] + 1] - densities[corners[2]])
    d = densities[corners[3]] + z * (densities[corners[3] + 1] - densities[corners[3]])
    a += y * (b - a)
    c += y * (d - c)
    return a + x * (c - a)


@kernel
def place_at(path, starts, directions, piece, distance, grid):
    """Where a path is after a distance that lies on one of its pieces, in cells from the grid's corner."""
    along, cells = distance - starts[piece], ONE / grid.voxel
    x = (path[piece, 0] + along * directions[piece, 0] - grid.minimum[0]) * cells
    y = (path[piece, 1] + along * directions[piece, 1] - grid.minimum[1]) * cells
    z = (path[piece, 2] + along * directions[piece, 2] - grid.minimum[2]) * cells
    return x, y, z


@allocating_kernel
def march(first_chunk, last_chunk, grid: Grid, rays: RayArrays, samples: Samples, limits: Limits):
    """Fill `samples`, and all of `rays` but the colors. The count of a chunk that needs more places is its capacity."""
    n_rays, n_knots = len(rays.jitter), rays.paths.shape[1]
    starts = np.empty(n_knots, np.float32)
    directions = np.empty((n_knots, 3), np.float32)
    for chunk in range(first_chunk, last_chunk):
        count = chunk * limits.capacity
        end = count + limits.capacity
        for ray in range(chunk * CHUNK, min(n_rays, (chunk + 1) * CHUNK)):
            polyline(rays.paths[ray], starts, directions)
            observation = ray - (n_rays - len(rays.observed))
            rays.reach[ray] = np.float32(-1)
            if observation >= 0:
                rays.reach[ray] = distance_to(
                    rays.observed[observation], rays.paths[ray], starts, directions, limits.off_path
                )
            rays.first[ray] = count
            count = march_ray(ray, count, end, starts, directions, grid, rays, samples, limits)
            rays.counts[ray] = count - rays.first[ray]
        samples.counts[chunk] = count - chunk * limits.capacity


@kernel
def march_ray(ray, count, end, starts, directions, grid, rays, samples, limits):
    """Samples of one ray from place `count` on; returns the place after the last one. A ray that is not finite has none."""
    path, jitter, reach, sums = rays.paths[ray], rays.jitter[ray], rays.reach[ray], rays.sums[ray]
    cells, blocks = grid.cells, grid.blocks
    step = limits.step * grid.voxel
    stride = np.float32(BLOCK) * step
    unit = ONE / limits.unit
    n_pieces = len(path) - 1
    is_bent, length = n_pieces > 1, starts[n_pieces]
    light, depth = ONE, ZERO
    weight_sum, distance_sum, square_sum, pairs, before, up_to, alpha_sum = ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO
    coarse_piece, piece, block = 0, 0, -1
    if not length < MOST_STEPS * step:  # not finite: such a ray would never end
        sums[FINAL_TRANSMITTANCE] = math.nan
        return count
    while light > DARK:
        block += 1
        distance = (np.float32(block) + HALF) * stride
        if distance - HALF * stride >= length:
            break
        while coarse_piece + 1 < n_pieces and starts[coarse_piece + 1] <= distance:
            coarse_piece += 1
        x, y, z = place_at(path, starts, directions, coarse_piece, distance, grid)
        i = min(max(int(x * np.float32(1 / BLOCK)), 0), blocks.x - 1)
        j = min(max(int(y * np.float32(1 / BLOCK)), 0), blocks.y - 1)
        k = min(max(int(z * np.float32(1 / BLOCK)), 0), blocks.z - 1)
        if grid.coarse[(i * blocks.y + j) * blocks.z + k] == 0:
            continue
        for number in range(block * BLOCK, (block + 1) * BLOCK):
            distance = (np.float32(number) + jitter) * step
            if distance >= length:
                break
            while piece + 1 < n_pieces and starts[piece + 1] <= distance:
                piece += 1
            x, y, z = place_at(path, starts, directions, piece, distance, grid)
            # bent paths are not clipped to the grid
            if is_bent and (x < 0 or y < 0 or z < 0 or x >= cells.x or y >= cells.y or z >= cells.z):
                continue
            i = min(max(int(x), 0), cells.x - 1)
            j = min(max(int(y), 0), cells.y - 1)
            k = min(max(int(z), 0), cells.z - 1)
            if (grid.bits[(i * cells.y + j) * grid.row_bytes + (k >> 3)] >> (k & 7)) & 1 == 0:
                continue
            if count == end:
                return end  # a full chunk is computed again with more places
            x, y, z = x - np.float32(i), y - np.float32(j), z - np.float32(k)
            lowest = i * grid.plane_stride + j * grid.row_stride + k
            corners = corners_of(grid, lowest)
            raw = raw_density(grid.densities, corners, x, y, z) + grid.bias
            small = math.exp(-abs(raw))
            softplus = max(raw, ZERO) + (math.log(ONE + small) if small > np.float32(1e-4) or raw > ZERO else small)
            optical_depth = softplus * limits.step
            slope = (ONE if raw > ZERO else small) / (ONE + small)
            through = math.exp(-optical_depth)
            alpha = ONE - through
            if optical_depth < np.float32(1e-3):  # the difference would lose its digits
                alpha = optical_depth * (ONE - HALF * optical_depth)
            weight = light * alpha
            scaled = distance * unit
            pairs += weight * (TWO * (scaled * weight_sum - distance_sum) + step * unit * THIRD * weight)
            weight_sum += weight
            distance_sum += weight * scaled
            square_sum += weight * scaled * scaled
            alpha_sum += alpha
            if reach >= ZERO:
                before += weight if distance < reach - limits.margin else ZERO
                up_to += weight if distance < reach + limits.margin else ZERO
            depth += optical_depth
            light *= through
            samples.vertices[count] = lowest
            for corner in range(4):
                samples.corners[count, corner] = corners[corner]
            samples.rays[count] = ray
            place, lit = samples.places[count], samples.light[count]
            place.x, place.y, place.z, place.distance = x, y, z, distance
            lit.weight, lit.transmittance, lit.behind, lit.slope = weight, through, light, slope * limits.step
            samples.shares[count] = share_of(weight, limits, ray, number)
            count += 1
            if light <= DARK:
                break
    sums[FINAL_TRANSMITTANCE], sums[DISTORTION] = math.exp(-depth), pairs
    sums[BEFORE], sums[UP_TO] = before, up_to
    sums[DISTANCE], sums[SQUARE], sums[ALPHA] = distance_sum, square_sum, alpha_sum
    return count


@kernel
def share_of(weight, limits, ray, number):
    """What a sample's color counts for: nothing, or one over the probability that it is drawn (Russian roulette)."""
    if limits.russian_roulette == ZERO:
        return ONE if weight > VISIBLE else ZERO
    if weight >= limits.russian_roulette:
        return ONE
    if uniform(limits.seed, ray, number) * limits.russian_roulette < weight:
        return limits.russian_roulette / weight
    return ZERO


@kernel
def count_places(first, last, pieces, grid, samples, bins, capacity):
    """Of each piece of the chunks, how many samples lie in each bin: a part of a plane of the grid."""
    plane = grid.plane_stride
    parts = bins.shape[1] // (grid.cells.x + 1)  # of each plane
    for piece in range(first, last):
        own = bins[piece]
        own[:] = 0
        for chunk in range(pieces[piece], pieces[piece + 1]):
            for sample in range(chunk * capacity, chunk * capacity + samples.counts[chunk]):
                own[bin_of(samples.vertices[sample], plane, parts)] += 1


@kernel
def place_bins(n_planes, bins, planes):
    """Where in the order each piece's samples of each bin begin, in place of their numbers; how many there are in all."""
    parts = bins.shape[1] // n_planes
    total = 0
    for number in range(n_planes * parts):
        if number % parts == 0:
            planes[number // parts] = total
        for piece in range(len(bins)):
            total, bins[piece, number] = total + bins[piece, number], total
    planes[n_planes] = total
    return total


@kernel
def put_in_place(first, last, pieces, grid, samples, ordered, bins, capacity):
    """Write the samples of these pieces of the chunks in order: a stable counting sort, however they are cut."""
    plane = grid.plane_stride
    parts = bins.shape[1] // (grid.cells.x + 1)
    for piece in range(first, last):
        for chunk in range(pieces[piece], pieces[piece + 1]):
            for sample in range(chunk * capacity, chunk * capacity + samples.counts[chunk]):
                number = bin_of(samples.vertices[sample], plane, parts)
                to = bins[piece, number]
                bins[piece, number] = to + 1
                ordered.index[to] = sample
                for corner in range(4):
                    ordered.corners[to, corner] = samples.corners[sample, corner]
                ordered.rays[to] = samples.rays[sample]
                own, place = ordered.places[to], samples.places[sample]
                own.x, own.y, own.z, own.share = place.x, place.y, place.z, samples.shares[sample]


@kernel
def bin_of(vertex, plane, parts):
    """Number of the part of a plane that a vertex lies in."""
    i = vertex // plane
    return i * parts + (vertex - i * plane) * parts // plane


@kernel
def mark_visible(n_chunks, samples, capacity, visibility):
    """Raise `visibility` of each cell, by the row of its lowest vertex, to the largest weight of a sample in it."""
    for chunk in range(n_chunks):
        for sample in range(chunk * capacity, chunk * capacity + samples.counts[chunk]):
            cell = samples.corners[sample, 0]
            visibility[cell] = max(visibility[cell], samples.light[sample].weight)
