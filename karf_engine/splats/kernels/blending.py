"""Assignment of Gaussians to tiles, their alpha compositing from near to far, and its gradients (Kerbl et al. 2023).

Pixels are processed in rows of LANES, which become vector instructions: all numbers are float32, those of a tile are in
one array, and exp is a polynomial. The backward pass also goes from near to far: the color behind a Gaussian is the
final color less the sum so far. Gradients have one row per Gaussian and tile, so results do not depend on the threads.

Kernels take tiles first to last; splats [n] of SPLAT; entries [E] of ENTRY; starts [T + 1], first entry of each tile.
"""

from __future__ import annotations

import math

import numpy as np

from ...compute.kernels import allocating_kernel, kernel
from .arrays import BLOCKS, CHECK_EVERY, DARK, HALF, LANES, MAX_ALPHA, MIN_ALPHA, ONE, TILE, ZERO

# polynomial for exp(t), -1 <= t <= 0; error of its eighth power 2e-6
E2, E3, E4, E5, E6 = map(np.float32, (0.499999, 0.16664, 0.041486, 0.007968, 0.00095))
EIGHTH, FARTHEST = np.float32(-0.125), np.float32(8)
MAX_ENTRIES = 1 << 30  # 8 GiB of entries; the sums fit into int32


@kernel
def count_entries(boxes, tiles_x, offsets, starts):
    """Count the entries of each Gaussian and tile; return False, with nothing counted, above MAX_ENTRIES.

    boxes: [n] of TILE_BOX. Writes offsets [n + 1], the first entry of each Gaussian in the order of the table, and adds
    to starts, which are zeros.
    """
    total = 0  # int64
    offsets[0] = 0
    for g in range(len(boxes)):
        box = boxes[g]
        total += (box.right - box.left) * (box.bottom - box.top)
        if total > MAX_ENTRIES:
            return False
        offsets[g + 1] = total
    for g in range(len(boxes)):
        box = boxes[g]
        for y in range(box.top, box.bottom):
            for x in range(box.left, box.right):
                starts[y * tiles_x + x + 1] += 1
    for tile in range(len(starts) - 1):
        starts[tile + 1] += starts[tile]
    return True


@kernel
def fill_entries(order, boxes, tiles_x, offsets, free, entries):
    """Write the `entries` of all tiles, of Gaussians in order from near to far; overwrite free, their first ones."""
    for g in order:
        box, row = boxes[g], offsets[g]
        for y in range(box.top, box.bottom):
            for x in range(box.left, box.right):
                entry = entries[free[y * tiles_x + x]]
                entry.gaussian, entry.row = g, row
                free[y * tiles_x + x] += 1
                row += 1


@kernel
def falloff(power):
    """Return exp(-power) for 0 <= power <= 8."""
    t = min(power, FARTHEST) * EIGHTH
    e = ONE + t * (ONE + t * (E2 + t * (E3 + t * (E4 + t * (E5 + t * E6)))))
    e *= e
    e *= e
    return e * e


@kernel
def is_dark(pixels):
    """Return True if the transmittance, channel 0 of [TILE, BLOCKS, C, LANES], is at most DARK in all pixels."""
    for row in range(TILE):
        for block in range(BLOCKS):
            for lane in range(LANES):
                if pixels[row, block, 0, lane] > DARK:
                    return False
    return True


@kernel
def rows_of(splat, top):
    """Return the range of rows of a tile that a splat touches."""
    middle = splat.v - np.float32(top)
    first, last = math.floor(middle - splat.reach_y), math.ceil(middle + splat.reach_y)
    return int(max(ZERO, first)), int(min(np.float32(TILE), last))


@kernel
def blocks_of(splat, left):
    """Return the range of blocks of LANES columns of a tile that a splat touches."""
    middle = splat.u - np.float32(left)
    first, last = math.floor(middle - splat.reach_x), math.ceil(middle + splat.reach_x)
    return int(max(ZERO, first)) // LANES, (int(min(np.float32(TILE), last)) - 1) // LANES + 1


@allocating_kernel
def blend(first, last, splats, entries, starts, background, image):
    """Write colors and transmittance to `image` [H, W, 4]."""
    height, width = image.shape[:2]
    tiles_x = -(-width // TILE)
    pixels = np.empty((TILE, BLOCKS, 4, LANES), np.float32)  # transmittance, red, green, blue
    for tile in range(first, last):
        left, top = (tile % tiles_x) * TILE, (tile // tiles_x) * TILE
        pixels[:] = 0
        pixels[:, :, 0] = 1
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
                        alpha = min(alpha, MAX_ALPHA) if alpha >= MIN_ALPHA else ZERO
                        weight = alpha * pixels[row, block, 0, lane]
                        pixels[row, block, 1, lane] += weight * red
                        pixels[row, block, 2, lane] += weight * green
                        pixels[row, block, 3, lane] += weight * blue
                        pixels[row, block, 0, lane] -= weight
            if (e - starts[tile]) % CHECK_EVERY == CHECK_EVERY - 1 and is_dark(pixels):
                break
        for row in range(min(TILE, height - top)):
            for column in range(min(TILE, width - left)):
                block, lane = column // LANES, column % LANES
                transmittance = pixels[row, block, 0, lane]
                for channel in range(3):
                    color = pixels[row, block, 1 + channel, lane] + transmittance * background[channel]
                    image[top + row, left + column, channel] = color
                image[top + row, left + column, 3] = transmittance


@allocating_kernel
def blend_values(first, last, splats, entries, starts, values, image):
    """Blend values [n, C] like colors over 0 into `image` [C, H, W]."""
    n_values, height, width = image.shape
    tiles_x = -(-width // TILE)
    pixels = np.empty((TILE, BLOCKS, 1 + n_values, LANES), np.float32)
    weights = np.empty(LANES, np.float32)
    for tile in range(first, last):
        left, top = (tile % tiles_x) * TILE, (tile // tiles_x) * TILE
        pixels[:] = 0
        pixels[:, :, 0] = 1
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
                        alpha = min(alpha, MAX_ALPHA) if alpha >= MIN_ALPHA else ZERO
                        weights[lane] = alpha * pixels[row, block, 0, lane]
                        pixels[row, block, 0, lane] -= weights[lane]
                    for k in range(n_values):
                        value = values[g, k]
                        if value != ZERO:
                            for lane in range(LANES):
                                pixels[row, block, 1 + k, lane] += weights[lane] * value
            if (e - starts[tile]) % CHECK_EVERY == CHECK_EVERY - 1 and is_dark(pixels):
                break
        for k in range(n_values):
            for row in range(min(TILE, height - top)):
                for column in range(min(TILE, width - left)):
                    image[k, top + row, left + column] = pixels[row, column // LANES, 1 + k, column % LANES]


@allocating_kernel
def blend_back(first, last, splats, entries, starts, image, gradient, splat_gradients):
    """Write `splat_gradients` [E] of SPLAT_GRADIENTS from the image and the gradient [H, W, 3] of its colors."""
    height, width = image.shape[:2]
    tiles_x = -(-width // TILE)
    pixels = np.empty((TILE, BLOCKS, 5, LANES), np.float32)  # transmittance, remainder, gradient of red, green, blue
    for tile in range(first, last):
        left, top = (tile % tiles_x) * TILE, (tile // tiles_x) * TILE
        pixels[:] = 0
        for row in range(min(TILE, height - top)):
            for column in range(min(TILE, width - left)):
                block, lane = column // LANES, column % LANES
                pixels[row, block, 0, lane] = 1
                for channel in range(3):
                    upstream = gradient[top + row, left + column, channel]
                    pixels[row, block, 2 + channel, lane] = upstream
                    pixels[row, block, 1, lane] += upstream * image[top + row, left + column, channel]
        done = False
        for e in range(starts[tile], starts[tile + 1]):
            out, splat = splat_gradients[entries[e].row], splats[entries[e].gaussian]
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
                        is_unclamped = ONE if alpha < MAX_ALPHA else ZERO
                        alpha = min(alpha, MAX_ALPHA) if alpha >= MIN_ALPHA else ZERO
                        transmittance = pixels[row, block, 0, lane]
                        weight = alpha * transmittance
                        along = red * pixels[row, block, 2, lane] + green * pixels[row, block, 3, lane]
                        along += blue * pixels[row, block, 4, lane]
                        remainder = pixels[row, block, 1, lane] - weight * along
                        pixels[row, block, 1, lane] = remainder
                        pixels[row, block, 0, lane] = transmittance - weight
                        by_exponent = alpha * is_unclamped * (remainder / (ONE - alpha) - transmittance * along)
                        in_row += by_exponent
                        in_row_x += by_exponent * dx
                        by_a += by_exponent * dx * dx
                        by_red += weight * pixels[row, block, 2, lane]
                        by_green += weight * pixels[row, block, 3, lane]
                        by_blue += weight * pixels[row, block, 4, lane]
                by_power += in_row
                by_u += in_row_x
                by_v += in_row * dy
                by_b += in_row_x * dy
                by_c += in_row * dy * dy
            out.u, out.v = -(a * by_u + b * by_v), -(b * by_u + c * by_v)
            out.a, out.b, out.c = HALF * by_a, by_b, HALF * by_c
            out.opacity = -by_power / opacity
            out.red, out.green, out.blue = by_red, by_green, by_blue
            done = (e - starts[tile]) % CHECK_EVERY == CHECK_EVERY - 1 and is_dark(pixels)
