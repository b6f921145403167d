"""Blending the Gaussians of each tile from near to far, and the gradients of that (Kerbl et al. 2023).

A Gaussian touches only the pixels of the box of its ellipse, in rows of LANES pixels that become vector instructions;
for that all numbers are float32, those of a tile lie in one array, and exp is a polynomial. The way back goes from near
to far again: what is behind is the final color less what has been added so far. Each pair of Gaussian and tile has a
row of slopes of its own, so the sums are the same on any number of threads.
"""

from __future__ import annotations

import math

import numpy as np

from ...compute.kernels import allocating_kernel, kernel
from .arrays import BLOCKS, DARK, HALF, LANES, LEAST_ALPHA, LOOK_EVERY, MOST_ALPHA, ONE, TILE, ZERO

# exp(t) for -1 <= t <= 0, least squares; to the eighth power 2e-6 off
E2, E3, E4, E5, E6 = map(np.float32, (0.499999, 0.16664, 0.041486, 0.007968, 0.00095))
EIGHTH, FARTHEST = np.float32(-0.125), np.float32(8)


@kernel
def falloff(power):
    """exp(-power) for 0 <= power <= 8."""
    t = min(power, FARTHEST) * EIGHTH
    e = ONE + t * (ONE + t * (E2 + t * (E3 + t * (E4 + t * (E5 + t * E6)))))
    e *= e
    e *= e
    return e * e


@kernel
def is_dark(light):
    """Whether hardly any light is left in all pixels [TILE, BLOCKS, C, LANES], channel 0, of a tile."""
    for row in range(TILE):
        for block in range(BLOCKS):
            for lane in range(LANES):
                if light[row, block, 0, lane] > DARK:
                    return False
    return True


@kernel
def rows_of(splat, top):
    """First and last but one row of a tile that a splat touches."""
    middle = splat.v - np.float32(top)
    first, last = math.floor(middle - splat.reach_y), math.ceil(middle + splat.reach_y)
    return int(max(ZERO, first)), int(min(np.float32(TILE), last))


@kernel
def blocks_of(splat, left):
    """First and last but one block of LANES columns of a tile that a splat touches."""
    middle = splat.u - np.float32(left)
    first, last = math.floor(middle - splat.reach_x), math.ceil(middle + splat.reach_x)
    return int(max(ZERO, first)) // LANES, (int(min(np.float32(TILE), last)) - 1) // LANES + 1


@allocating_kernel
def blend(first, last, splats, entries, starts, background, image):
    """Write the colors of the tiles first to last.

    Args:
        first: Tile.
        last: Tile.
        splats: [n] of SPLAT.
        entries: Of all tiles, ENTRY.
        starts: [T + 1], the first entry of each tile.
        background: [3].
        image: [H, W, 4], colors and transmittance.
    """
    height, width = image.shape[:2]
    tiles_x = -(-width // TILE)
    now = np.empty((TILE, BLOCKS, 4, LANES), np.float32)  # light that is left, red, green, blue
    for tile in range(first, last):
        left, top = (tile % tiles_x) * TILE, (tile // tiles_x) * TILE
        now[:] = 0
        now[:, :, 0] = 1
        for e in range(starts[tile], starts[tile + 1]):
            splat = splats[entries[e].gaussian]
            u, v = splat.u - np.float32(left), splat.v - np.float32(top)
            a, b, c, opacity = splat.a, splat.b, splat.c, splat.opacity
            red, green, blue = splat.red, splat.green, splat.blue
            row0, row1 = rows_of(splat, top)
            block0, block1 = blocks_of(splat, left)
            for row in range(row0, row1):
                dy = np.float32(row) + HALF - v
                for block in range(block0, block1):
                    start = np.float32(block * LANES) + HALF - u
                    for lane in range(LANES):
                        dx = np.float32(lane) + start
                        alpha = opacity * falloff(HALF * (a * dx * dx + c * dy * dy) + b * dx * dy)
                        alpha = min(alpha, MOST_ALPHA) if alpha >= LEAST_ALPHA else ZERO
                        weight = alpha * now[row, block, 0, lane]
                        now[row, block, 1, lane] += weight * red
                        now[row, block, 2, lane] += weight * green
                        now[row, block, 3, lane] += weight * blue
                        now[row, block, 0, lane] -= weight
            if (e - starts[tile]) % LOOK_EVERY == LOOK_EVERY - 1 and is_dark(now):
                break
        for row in range(min(TILE, height - top)):
            for column in range(min(TILE, width - left)):
                block, lane = column // LANES, column % LANES
                light = now[row, block, 0, lane]
                for channel in range(3):
                    color = now[row, block, 1 + channel, lane] + light * background[channel]
                    image[top + row, left + column, channel] = color
                image[top + row, left + column, 3] = light


@allocating_kernel
def blend_values(first, last, splats, entries, starts, values, image):
    """Write any values blended as colors are, of the tiles first to last, over 0.

    Args:
        first: Tile.
        last: Tile.
        splats: [n] of SPLAT.
        entries: Of all tiles, ENTRY.
        starts: [T + 1], the first entry of each tile.
        values: [n, C].
        image: [C, H, W].
    """
    n_values, height, width = image.shape
    tiles_x = -(-width // TILE)
    now = np.empty((TILE, BLOCKS, 1 + n_values, LANES), np.float32)
    weights = np.empty(LANES, np.float32)
    for tile in range(first, last):
        left, top = (tile % tiles_x) * TILE, (tile // tiles_x) * TILE
        now[:] = 0
        now[:, :, 0] = 1
        for e in range(starts[tile], starts[tile + 1]):
            g = entries[e].gaussian
            splat = splats[g]
            u, v = splat.u - np.float32(left), splat.v - np.float32(top)
            a, b, c, opacity = splat.a, splat.b, splat.c, splat.opacity
            row0, row1 = rows_of(splat, top)
            block0, block1 = blocks_of(splat, left)
            for row in range(row0, row1):
                dy = np.float32(row) + HALF - v
                for block in range(block0, block1):
                    start = np.float32(block * LANES) + HALF - u
                    for lane in range(LANES):
                        dx = np.float32(lane) + start
                        alpha = opacity * falloff(HALF * (a * dx * dx + c * dy * dy) + b * dx * dy)
                        alpha = min(alpha, MOST_ALPHA) if alpha >= LEAST_ALPHA else ZERO
                        weights[lane] = alpha * now[row, block, 0, lane]
                        now[row, block, 0, lane] -= weights[lane]
                    for k in range(n_values):
                        value = values[g, k]
                        if value != ZERO:
                            for lane in range(LANES):
                                now[row, block, 1 + k, lane] += weights[lane] * value
            if (e - starts[tile]) % LOOK_EVERY == LOOK_EVERY - 1 and is_dark(now):
                break
        for k in range(n_values):
            for row in range(min(TILE, height - top)):
                for column in range(min(TILE, width - left)):
                    image[k, top + row, left + column] = now[row, column // LANES, 1 + k, column % LANES]


@allocating_kernel
def blend_back(first, last, splats, entries, starts, image, gradient, slopes):
    """Write the slopes of all entries of the tiles first to last.

    Args:
        first: Tile.
        last: Tile.
        splats: [n] of SPLAT.
        entries: Of all tiles, ENTRY.
        starts: [T + 1], the first entry of each tile.
        image: [H, W, 4], as blended.
        gradient: [H, W, 3], of the loss to its colors.
        slopes: [S] of SLOPES.
    """
    height, width = image.shape[:2]
    tiles_x = -(-width // TILE)
    now = np.empty((TILE, BLOCKS, 5, LANES), np.float32)  # light, what is behind, gradient of red, green and blue
    for tile in range(first, last):
        left, top = (tile % tiles_x) * TILE, (tile // tiles_x) * TILE
        now[:] = 0
        for row in range(min(TILE, height - top)):
            for column in range(min(TILE, width - left)):
                block, lane = column // LANES, column % LANES
                now[row, block, 0, lane] = 1
                for channel in range(3):
                    slope = gradient[top + row, left + column, channel]
                    now[row, block, 2 + channel, lane] = slope
                    now[row, block, 1, lane] += slope * image[top + row, left + column, channel]
        done = False
        for e in range(starts[tile], starts[tile + 1]):
            out, splat = slopes[entries[e].slot], splats[entries[e].gaussian]
            out.u = out.v = out.a = out.b = out.c = out.opacity = out.red = out.green = out.blue = ZERO
            if done:
                continue
            u, v = splat.u - np.float32(left), splat.v - np.float32(top)
            a, b, c, opacity = splat.a, splat.b, splat.c, splat.opacity
            red, green, blue = splat.red, splat.green, splat.blue
            row0, row1 = rows_of(splat, top)
            block0, block1 = blocks_of(splat, left)
            by_u, by_v, by_a, by_b, by_c, by_power = ZERO, ZERO, ZERO, ZERO, ZERO, ZERO
            by_red, by_green, by_blue = ZERO, ZERO, ZERO
            for row in range(row0, row1):
                dy = np.float32(row) + HALF - v
                in_row, in_row_x = ZERO, ZERO
                for block in range(block0, block1):
                    start = np.float32(block * LANES) + HALF - u
                    for lane in range(LANES):
                        dx = np.float32(lane) + start
                        alpha = opacity * falloff(HALF * (a * dx * dx + c * dy * dy) + b * dx * dy)
                        is_free = ONE if alpha < MOST_ALPHA else ZERO
                        alpha = min(alpha, MOST_ALPHA) if alpha >= LEAST_ALPHA else ZERO
                        light = now[row, block, 0, lane]
                        weight = alpha * light
                        along = red * now[row, block, 2, lane] + green * now[row, block, 3, lane]
                        along += blue * now[row, block, 4, lane]
                        behind = now[row, block, 1, lane] - weight * along
                        now[row, block, 1, lane] = behind
                        now[row, block, 0, lane] = light - weight
                        slope = alpha * is_free * (behind / (ONE - alpha) - light * along)
                        in_row += slope
                        in_row_x += slope * dx
                        by_a += slope * dx * dx
                        by_red += weight * now[row, block, 2, lane]
                        by_green += weight * now[row, block, 3, lane]
                        by_blue += weight * now[row, block, 4, lane]
                by_power += in_row
                by_u += in_row_x
                by_v += in_row * dy
                by_b += in_row_x * dy
                by_c += in_row * dy * dy
            out.u, out.v = -(a * by_u + b * by_v), -(b * by_u + c * by_v)
            out.a, out.b, out.c = HALF * by_a, by_b, HALF * by_c
            out.opacity = -by_power / opacity
            out.red, out.green, out.blue = by_red, by_green, by_blue
            done = (e - starts[tile]) % LOOK_EVERY == LOOK_EVERY - 1 and is_dark(now)
