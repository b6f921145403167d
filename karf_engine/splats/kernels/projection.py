"""Gaussians on the screen of a pinhole (Zwicker et al. 2001, "EWA Splatting"; Kerbl et al. 2023), and back."""

from __future__ import annotations

import math

import numpy as np

from ...compute.kernels import allocating_kernel, kernel
from .arrays import (
    BORDER,
    COLOR,
    HALF,
    LEAST_ALPHA,
    LOG_SCALE,
    LOGIT,
    ONE,
    ROTATION,
    TILE,
    ZERO,
)
from .harmonics import harmonic_slopes, harmonics

TWO, LARGEST = np.float32(2), np.float32(3e38)


@kernel
def rotate(row, rotation):
    """Write the rotation [3, 3] of a row's quaternion w x y z, of any length."""
    w, x, y, z = row[ROTATION], row[ROTATION + 1], row[ROTATION + 2], row[ROTATION + 3]
    norm = ONE / math.sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w * norm, x * norm, y * norm, z * norm
    rotation[0, 0], rotation[1, 1] = ONE - TWO * (y * y + z * z), ONE - TWO * (x * x + z * z)
    rotation[2, 2] = ONE - TWO * (x * x + y * y)
    rotation[0, 1], rotation[1, 0] = TWO * (x * y - w * z), TWO * (x * y + w * z)
    rotation[0, 2], rotation[2, 0] = TWO * (x * z + w * y), TWO * (x * z - w * y)
    rotation[1, 2], rotation[2, 1] = TWO * (y * z - w * x), TWO * (y * z + w * x)


@kernel
def place(row, camera, at):
    """Write a center's x y z in the camera, at [3]."""
    turn, shift = camera.turn, camera.shift
    for i in range(3):
        at[i] = turn[3 * i] * row[0] + turn[3 * i + 1] * row[1] + turn[3 * i + 2] * row[2] + shift[i]


@kernel
def flatten(row, camera, at, to_screen, rotation, scale, axes):
    """Write a placed Gaussian's axes on the screen.

    Args:
        row: Of the table.
        camera: Pinhole.
        at: [3], x y z in the camera.
        to_screen: [2, 3], slope of the projection by the world's axes.
        rotation: [3, 3].
        scale: [3].
        axes: [2, 3], the Gaussian's three axes on the screen, pixels.
    """
    turn = camera.turn
    for i in range(3):
        scale[i] = math.exp(row[LOG_SCALE + i])
    for j in range(3):
        to_screen[0, j] = camera.fx / at[2] * (turn[j] - at[0] / at[2] * turn[6 + j])
        to_screen[1, j] = camera.fy / at[2] * (turn[3 + j] - at[1] / at[2] * turn[6 + j])
    rotate(row, rotation)
    for i in range(2):
        for j in range(3):
            turned = to_screen[i, 0] * rotation[0, j] + to_screen[i, 1] * rotation[1, j]
            axes[i, j] = (turned + to_screen[i, 2] * rotation[2, j]) * scale[j]


@kernel
def direction(row, camera, way):
    """Write the unit direction [3] from the camera's place to a center; returns one over the distance."""
    for i in range(3):
        way[i] = row[i] - camera.eye[i]
    inverse = ONE / math.sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2])
    for i in range(3):
        way[i] *= inverse
    return inverse


@allocating_kernel
def project(first, last, table, camera, splats, tiles):
    """Write splats [n] and their tiles [n] of the rows first to last; unseen ones get no tiles.

    Nor do rows from which no finite ellipse follows: the questions are asked so that NaN is a no.

    Args:
        first: Row.
        last: Row.
        table: [n, 11 + 3 K].
        camera: Pinhole.
        splats: [n] of SPLAT.
        tiles: [n] of TILES.
    """
    count = (table.shape[1] - COLOR) // 3
    at, scale, way = np.empty(3, np.float32), np.empty(3, np.float32), np.empty(3, np.float32)
    to_screen, axes = np.empty((2, 3), np.float32), np.empty((2, 3), np.float32)
    rotation, basis = np.empty((3, 3), np.float32), np.empty(16, np.float32)
    width, height = np.float32(camera.width), np.float32(camera.height)
    border = np.float32(BORDER) * max(width, height)
    for g in range(first, last):
        row, splat, box = table[g], splats[g], tiles[g]
        box.left = box.right = box.top = box.bottom = 0
        place(row, camera, at)
        if not at[2] >= camera.near:
            continue
        u, v = camera.fx * at[0] / at[2] + camera.cx, camera.fy * at[1] / at[2] + camera.cy
        if not (-border <= u <= width + border and -border <= v <= height + border):
            continue
        flatten(row, camera, at, to_screen, rotation, scale, axes)
        xx = axes[0, 0] * axes[0, 0] + axes[0, 1] * axes[0, 1] + axes[0, 2] * axes[0, 2]
        xy = axes[0, 0] * axes[1, 0] + axes[0, 1] * axes[1, 1] + axes[0, 2] * axes[1, 2]
        yy = axes[1, 0] * axes[1, 0] + axes[1, 1] * axes[1, 1] + axes[1, 2] * axes[1, 2]
        sharp = xx * yy - xy * xy
        xx, yy = xx + camera.blur, yy + camera.blur
        area = xx * yy - xy * xy
        if not ZERO < area < LARGEST:
            continue
        opacity = math.sqrt(max(sharp / area, camera.least_share)) / (ONE + math.exp(-row[LOGIT]))
        if not opacity >= LEAST_ALPHA:
            continue
        reach = TWO * math.log(opacity / LEAST_ALPHA)
        reach_x, reach_y = math.sqrt(reach * xx), math.sqrt(reach * yy)
        left, right = max(ZERO, math.floor(u - reach_x)), min(width, math.ceil(u + reach_x))
        top, bottom = max(ZERO, math.floor(v - reach_y)), min(height, math.ceil(v + reach_y))
        if left >= right or top >= bottom:
            continue
        box.left, box.right = int(left) // TILE, (int(right) - 1) // TILE + 1
        box.top, box.bottom = int(top) // TILE, (int(bottom) - 1) // TILE + 1
        splat.u, splat.v, splat.depth = u, v, at[2]
        splat.a, splat.b, splat.c = yy / area, -xy / area, xx / area
        splat.opacity, splat.reach_x, splat.reach_y = opacity, reach_x, reach_y
        direction(row, camera, way)
        harmonics(way[0], way[1], way[2], count, basis)
        splat.red, splat.green, splat.blue = (
            seen_color(row, basis, count, 0),
            seen_color(row, basis, count, 1),
            seen_color(row, basis, count, 2),
        )


@kernel
def seen_color(row, basis, count, channel):
    """A channel's color of a row: half a gray and its harmonics, never under 0."""
    color = HALF
    for k in range(count):
        color += basis[k] * row[COLOR + 3 * k + channel]
    return max(color, ZERO)


@allocating_kernel
def project_back(first, last, table, camera, splats, slots, slopes, gradients):
    """Write the gradients of the table's rows first to last; those of unseen Gaussians are left as they are.

    Args:
        first: Row.
        last: Row.
        table: [n, 11 + 3 K].
        camera: Pinhole.
        splats: [n] of SPLAT, as projected.
        slots: [n + 1], the first row of slopes of each Gaussian.
        slopes: [S] of SLOPES, by Gaussian and tile.
        gradients: [n, 11 + 3 K].
    """
    count = (table.shape[1] - COLOR) // 3
    at, scale, way, color = (
        np.empty(3, np.float32),
        np.empty(3, np.float32),
        np.empty(3, np.float32),
        np.empty(3, np.float32),
    )
    to_screen, axes = np.empty((2, 3), np.float32), np.empty((2, 3), np.float32)
    by_turned, by_screen = np.empty((2, 3), np.float32), np.empty((2, 3), np.float32)
    rotation, by_rotation = np.empty((3, 3), np.float32), np.empty((3, 3), np.float32)
    basis, basis_slopes = np.empty(16, np.float32), np.empty((16, 3), np.float32)
    by_camera, by_way = np.empty(3, np.float32), np.empty(3, np.float32)
    turn = camera.turn
    for g in range(first, last):
        if slots[g + 1] == slots[g]:
            continue
        row, splat, out = table[g], splats[g], gradients[g]
        by_u, by_v, by_a, by_b, by_c, by_opacity = ZERO, ZERO, ZERO, ZERO, ZERO, ZERO
        color[0] = color[1] = color[2] = ZERO
        for slot in range(slots[g], slots[g + 1]):
            slope = slopes[slot]
            by_u, by_v = by_u + slope.u, by_v + slope.v
            by_a, by_b, by_c = by_a + slope.a, by_b + slope.b, by_c + slope.c
            by_opacity += slope.opacity
            color[0] += slope.red
            color[1] += slope.green
            color[2] += slope.blue
        place(row, camera, at)
        flatten(row, camera, at, to_screen, rotation, scale, axes)
        # the share of the opacity that the blur leaves
        xx = axes[0, 0] * axes[0, 0] + axes[0, 1] * axes[0, 1] + axes[0, 2] * axes[0, 2]
        xy = axes[0, 0] * axes[1, 0] + axes[0, 1] * axes[1, 1] + axes[0, 2] * axes[1, 2]
        yy = axes[1, 0] * axes[1, 0] + axes[1, 1] * axes[1, 1] + axes[1, 2] * axes[1, 2]
        sharp = xx * yy - xy * xy
        area = (xx + camera.blur) * (yy + camera.blur) - xy * xy
        by_xx, by_xy, by_yy = ZERO, ZERO, ZERO  # of the covariance [[xx, xy], [xy, yy]], xy taken once
        if sharp / area > camera.least_share:
            by_ratio = HALF * by_opacity * splat.opacity  # times the logarithm's slope
            by_xx = by_ratio * (yy / sharp - (yy + camera.blur) / area)
            by_yy = by_ratio * (xx / sharp - (xx + camera.blur) / area)
            by_xy = -by_ratio * TWO * xy * (ONE / sharp - ONE / area)
        solid = ONE / (ONE + math.exp(-row[LOGIT]))
        out[LOGIT] = by_opacity * splat.opacity * (ONE - solid)
        # from the inverse covariance to the covariance: -Q G Q
        a, b, c, half_b = splat.a, splat.b, splat.c, HALF * by_b
        ha, hb = a * by_a + b * half_b, a * half_b + b * by_c
        hc, hd = b * by_a + c * half_b, b * half_b + c * by_c
        by_xx -= ha * a + hb * b
        by_xy -= TWO * (ha * b + hb * c)
        by_yy -= hc * b + hd * c
        half_xy = HALF * by_xy
        for j in range(3):
            by_turned[0, j] = TWO * (by_xx * axes[0, j] + half_xy * axes[1, j])
            by_turned[1, j] = TWO * (half_xy * axes[0, j] + by_yy * axes[1, j])
            out[LOG_SCALE + j] = by_turned[0, j] * axes[0, j] + by_turned[1, j] * axes[1, j]
            by_turned[0, j] *= scale[j]
            by_turned[1, j] *= scale[j]
        for i in range(3):
            for j in range(3):
                by_rotation[i, j] = to_screen[0, i] * by_turned[0, j] + to_screen[1, i] * by_turned[1, j]
            for j in range(2):
                by_screen[j, i] = (
                    by_turned[j, 0] * rotation[i, 0]
                    + by_turned[j, 1] * rotation[i, 1]
                    + by_turned[j, 2] * rotation[i, 2]
                )
        rotate_back(row, by_rotation, out)
        # the projection's slope and the center, in the camera's axes
        z = at[2]
        slope_xx, slope_xz, slope_yy, slope_yz = ZERO, ZERO, ZERO, ZERO
        for j in range(3):
            slope_xx += by_screen[0, j] * turn[j]
            slope_xz += by_screen[0, j] * turn[6 + j]
            slope_yy += by_screen[1, j] * turn[3 + j]
            slope_yz += by_screen[1, j] * turn[6 + j]
        inverse_square = ONE / (z * z)
        by_camera[0] = camera.fx / z * by_u - camera.fx * inverse_square * slope_xz
        by_camera[1] = camera.fy / z * by_v - camera.fy * inverse_square * slope_yz
        by_camera[2] = -(by_camera[0] * at[0] + by_camera[1] * at[1]) / z
        by_camera[2] -= (camera.fx * slope_xx + camera.fy * slope_yy) * inverse_square
        by_camera[2] += (camera.fx * at[0] * slope_xz + camera.fy * at[1] * slope_yz) * inverse_square / z
        # colors, and through the direction the center again
        if splat.red <= ZERO:
            color[0] = ZERO
        if splat.green <= ZERO:
            color[1] = ZERO
        if splat.blue <= ZERO:
            color[2] = ZERO
        inverse = direction(row, camera, way)
        harmonics(way[0], way[1], way[2], count, basis)
        harmonic_slopes(way[0], way[1], way[2], count, basis_slopes)
        by_way[0] = by_way[1] = by_way[2] = ZERO
        for k in range(count):
            along = ZERO
            for channel in range(3):
                out[COLOR + 3 * k + channel] = basis[k] * color[channel]
                along += row[COLOR + 3 * k + channel] * color[channel]
            for j in range(3):
                by_way[j] += along * basis_slopes[k, j]
        along = by_way[0] * way[0] + by_way[1] * way[1] + by_way[2] * way[2]
        for j in range(3):
            in_world = turn[j] * by_camera[0] + turn[3 + j] * by_camera[1] + turn[6 + j] * by_camera[2]
            out[j] = in_world + (by_way[j] - along * way[j]) * inverse


@kernel
def rotate_back(row, by, out):
    """Write the gradient of a row's quaternion, of any length, from that of its rotation [3, 3]."""
    w, x, y, z = row[ROTATION], row[ROTATION + 1], row[ROTATION + 2], row[ROTATION + 3]
    norm = ONE / math.sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w * norm, x * norm, y * norm, z * norm
    zy, xz, yx = by[2, 1] - by[1, 2], by[0, 2] - by[2, 0], by[1, 0] - by[0, 1]
    xy, zx, yz = by[0, 1] + by[1, 0], by[0, 2] + by[2, 0], by[1, 2] + by[2, 1]
    by_w = TWO * (x * zy + y * xz + z * yx)
    by_x = TWO * (-TWO * x * (by[1, 1] + by[2, 2]) + y * xy + z * zx + w * zy)
    by_y = TWO * (x * xy - TWO * y * (by[0, 0] + by[2, 2]) + z * yz + w * xz)
    by_z = TWO * (x * zx + y * yz - TWO * z * (by[0, 0] + by[1, 1]) + w * yx)
    along = by_w * w + by_x * x + by_y * y + by_z * z
    out[ROTATION], out[ROTATION + 1] = (by_w - along * w) * norm, (by_x - along * x) * norm
    out[ROTATION + 2], out[ROTATION + 3] = (by_y - along * y) * norm, (by_z - along * z) * norm
