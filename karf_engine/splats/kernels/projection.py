"""Projection of Gaussians to the screen (Zwicker et al. 2001, "EWA Splatting"; Kerbl et al. 2023), and its gradients.

Harmonics are real, up to degree 3, with the order and signs of Kerbl et al. 2023.
A row of the table is [11 + 3 K] (see gaussians.Gaussians); the camera is an arrays.Pinhole.
"""

from __future__ import annotations

import math

import numpy as np

from ...compute.kernels import allocating_kernel, kernel
from .arrays import BORDER, C0, COLOR, HALF, LOG_SCALE, LOGIT, MIN_ALPHA, ONE, ROTATION, TILE, ZERO

C1 = np.float32(0.4886025119029199)
C4, C6, C8 = np.float32(1.0925484305920792), np.float32(0.31539156525252005), np.float32(0.5462742152960396)
C9, C10, C11 = np.float32(0.5900435899266435), np.float32(2.890611442640554), np.float32(0.4570457994644658)
C12, C14 = np.float32(0.3731763325901154), np.float32(1.445305721320277)
TWO, THREE, FOUR, SIX, EIGHT = map(np.float32, (2, 3, 4, 6, 8))
LARGEST = np.float32(3e38)


@kernel
def harmonics(x, y, z, count, values):
    """Write the first `count` harmonics (1, 4, 9 or 16) of a unit direction."""
    values[0] = C0
    if count > 1:
        values[1], values[2], values[3] = -C1 * y, C1 * z, -C1 * x
    if count > 4:
        values[4], values[5], values[7] = C4 * x * y, -C4 * y * z, -C4 * x * z
        values[6] = C6 * (TWO * z * z - x * x - y * y)
        values[8] = C8 * (x * x - y * y)
    if count > 9:
        values[9] = -C9 * y * (THREE * x * x - y * y)
        values[10] = C10 * x * y * z
        values[11] = -C11 * y * (FOUR * z * z - x * x - y * y)
        values[12] = C12 * z * (TWO * z * z - THREE * x * x - THREE * y * y)
        values[13] = -C11 * x * (FOUR * z * z - x * x - y * y)
        values[14] = C14 * z * (x * x - y * y)
        values[15] = -C9 * x * (x * x - THREE * y * y)


@kernel
def harmonic_gradients(x, y, z, count, gradients):
    """Write the partial derivatives of the first `count` harmonics with respect to x, y, z, [count, 3]."""
    gradients[:count] = 0
    if count > 1:
        gradients[1, 1], gradients[2, 2], gradients[3, 0] = -C1, C1, -C1
    if count > 4:
        gradients[4, 0], gradients[4, 1] = C4 * y, C4 * x
        gradients[5, 1], gradients[5, 2] = -C4 * z, -C4 * y
        gradients[6, 0], gradients[6, 1], gradients[6, 2] = -TWO * C6 * x, -TWO * C6 * y, FOUR * C6 * z
        gradients[7, 0], gradients[7, 2] = -C4 * z, -C4 * x
        gradients[8, 0], gradients[8, 1] = TWO * C8 * x, -TWO * C8 * y
    if count > 9:
        xx, yy, zz = x * x, y * y, z * z
        gradients[9, 0], gradients[9, 1] = -SIX * C9 * x * y, -THREE * C9 * (xx - yy)
        gradients[10, 0], gradients[10, 1], gradients[10, 2] = C10 * y * z, C10 * x * z, C10 * x * y
        gradients[11, 0], gradients[11, 2] = TWO * C11 * x * y, -EIGHT * C11 * y * z
        gradients[11, 1] = -C11 * (FOUR * zz - xx - THREE * yy)
        gradients[12, 0], gradients[12, 1] = -SIX * C12 * x * z, -SIX * C12 * y * z
        gradients[12, 2] = C12 * (SIX * zz - THREE * xx - THREE * yy)
        gradients[13, 0] = -C11 * (FOUR * zz - THREE * xx - yy)
        gradients[13, 1], gradients[13, 2] = TWO * C11 * x * y, -EIGHT * C11 * x * z
        gradients[14, 0], gradients[14, 1], gradients[14, 2] = TWO * C14 * x * z, -TWO * C14 * y * z, C14 * (xx - yy)
        gradients[15, 0], gradients[15, 1] = -THREE * C9 * (xx - yy), SIX * C9 * x * y


@kernel
def rotate(row, rotation):
    """Write the rotation [3, 3] of a row's quaternion."""
    w, x, y, z = row[ROTATION], row[ROTATION + 1], row[ROTATION + 2], row[ROTATION + 3]
    norm = ONE / math.sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w * norm, x * norm, y * norm, z * norm
    rotation[0, 0], rotation[1, 1] = ONE - TWO * (y * y + z * z), ONE - TWO * (x * x + z * z)
    rotation[2, 2] = ONE - TWO * (x * x + y * y)
    rotation[0, 1], rotation[1, 0] = TWO * (x * y - w * z), TWO * (x * y + w * z)
    rotation[0, 2], rotation[2, 0] = TWO * (x * z + w * y), TWO * (x * z - w * y)
    rotation[1, 2], rotation[2, 1] = TWO * (y * z - w * x), TWO * (y * z + w * x)


@kernel
def to_camera(row, camera, center):
    """Write the center [3] in camera coordinates."""
    view, translation = camera.rotation, camera.translation
    for i in range(3):
        center[i] = view[3 * i] * row[0] + view[3 * i + 1] * row[1] + view[3 * i + 2] * row[2] + translation[i]


@kernel
def project_axes(row, camera, center, jacobian, rotation, scale, axes):
    """Write the Gaussian's three axes on the screen, [2, 3] pixels, and what they are computed from.

    center: in camera coordinates; jacobian: [2, 3], of the projection with respect to world coordinates.
    """
    view = camera.rotation
    for i in range(3):
        scale[i] = math.exp(row[LOG_SCALE + i])
    for j in range(3):
        jacobian[0, j] = camera.fx / center[2] * (view[j] - center[0] / center[2] * view[6 + j])
        jacobian[1, j] = camera.fy / center[2] * (view[3 + j] - center[1] / center[2] * view[6 + j])
    rotate(row, rotation)
    for i in range(2):
        for j in range(3):
            projected = jacobian[i, 0] * rotation[0, j] + jacobian[i, 1] * rotation[1, j]
            axes[i, j] = (projected + jacobian[i, 2] * rotation[2, j]) * scale[j]


@kernel
def direction(row, camera, viewdir):
    """Write the unit direction [3] from the camera to the center; return 1 / distance."""
    for i in range(3):
        viewdir[i] = row[i] - camera.eye[i]
    inverse = ONE / math.sqrt(viewdir[0] * viewdir[0] + viewdir[1] * viewdir[1] + viewdir[2] * viewdir[2])
    for i in range(3):
        viewdir[i] *= inverse
    return inverse


@allocating_kernel
def project(first, last, table, camera, splats, boxes):
    """Write `splats` [n] of SPLAT and their `boxes` [n] of TILE_BOX for rows first to last.

    Invisible Gaussians and those without a finite ellipse get an empty box; comparisons are False for NaN.
    """
    count = (table.shape[1] - COLOR) // 3
    center, scale, viewdir = np.empty(3, np.float32), np.empty(3, np.float32), np.empty(3, np.float32)
    jacobian, axes = np.empty((2, 3), np.float32), np.empty((2, 3), np.float32)
    rotation, basis = np.empty((3, 3), np.float32), np.empty(16, np.float32)
    width, height = np.float32(camera.width), np.float32(camera.height)
    border = np.float32(BORDER) * max(width, height)
    for g in range(first, last):
        row, splat, box = table[g], splats[g], boxes[g]
        box.left = box.right = box.top = box.bottom = 0
        to_camera(row, camera, center)
        if not center[2] >= camera.near:
            continue
        u, v = camera.fx * center[0] / center[2] + camera.cx, camera.fy * center[1] / center[2] + camera.cy
        if not (-border <= u <= width + border and -border <= v <= height + border):
            continue
        project_axes(row, camera, center, jacobian, rotation, scale, axes)
        xx = axes[0, 0] * axes[0, 0] + axes[0, 1] * axes[0, 1] + axes[0, 2] * axes[0, 2]
        xy = axes[0, 0] * axes[1, 0] + axes[0, 1] * axes[1, 1] + axes[0, 2] * axes[1, 2]
        yy = axes[1, 0] * axes[1, 0] + axes[1, 1] * axes[1, 1] + axes[1, 2] * axes[1, 2]
        unblurred = xx * yy - xy * xy
        xx, yy = xx + camera.blur, yy + camera.blur
        area = xx * yy - xy * xy
        if not ZERO < area < LARGEST:
            continue
        opacity = math.sqrt(max(unblurred / area, camera.least_share)) / (ONE + math.exp(-row[LOGIT]))
        if not opacity >= MIN_ALPHA:
            continue
        reach = TWO * math.log(opacity / MIN_ALPHA)
        reach_x, reach_y = math.sqrt(reach * xx), math.sqrt(reach * yy)
        left, right = max(ZERO, math.floor(u - reach_x)), min(width, math.ceil(u + reach_x))
        top, bottom = max(ZERO, math.floor(v - reach_y)), min(height, math.ceil(v + reach_y))
        if left >= right or top >= bottom:
            continue
        box.left, box.right = int(left) // TILE, (int(right) - 1) // TILE + 1
        box.top, box.bottom = int(top) // TILE, (int(bottom) - 1) // TILE + 1
        splat.u, splat.v, splat.depth = u, v, center[2]
        splat.a, splat.b, splat.c = yy / area, -xy / area, xx / area
        splat.opacity, splat.reach_x, splat.reach_y = opacity, reach_x, reach_y
        direction(row, camera, viewdir)
        harmonics(viewdir[0], viewdir[1], viewdir[2], count, basis)
        splat.red = seen_color(row, basis, count, 0)
        splat.green = seen_color(row, basis, count, 1)
        splat.blue = seen_color(row, basis, count, 2)


@kernel
def seen_color(row, basis, count, channel):
    """Return max(0, 0.5 + sum of harmonics) of a channel."""
    color = HALF
    for k in range(count):
        color += basis[k] * row[COLOR + 3 * k + channel]
    return max(color, ZERO)


@allocating_kernel
def project_back(first, last, table, camera, splats, offsets, splat_gradients, gradients):
    """Write the `gradients` of visible rows first to last; other rows are unchanged.

    offsets: [n + 1], first row of each Gaussian in splat_gradients, [E] of SPLAT_GRADIENTS; gradients: [n, 11 + 3 K].
    """
    count = (table.shape[1] - COLOR) // 3
    center, scale = np.empty(3, np.float32), np.empty(3, np.float32)
    viewdir, color = np.empty(3, np.float32), np.empty(3, np.float32)
    jacobian, axes = np.empty((2, 3), np.float32), np.empty((2, 3), np.float32)
    by_axes, by_jacobian = np.empty((2, 3), np.float32), np.empty((2, 3), np.float32)
    rotation, by_rotation = np.empty((3, 3), np.float32), np.empty((3, 3), np.float32)
    basis, basis_gradients = np.empty(16, np.float32), np.empty((16, 3), np.float32)
    by_camera, by_viewdir = np.empty(3, np.float32), np.empty(3, np.float32)
    view = camera.rotation
    for g in range(first, last):
        if offsets[g + 1] == offsets[g]:
            continue
        row, splat, out = table[g], splats[g], gradients[g]
        by_u, by_v, by_a, by_b, by_c, by_opacity = ZERO, ZERO, ZERO, ZERO, ZERO, ZERO
        color[0] = color[1] = color[2] = ZERO
        for entry in range(offsets[g], offsets[g + 1]):
            by_splat = splat_gradients[entry]
            by_u, by_v = by_u + by_splat.u, by_v + by_splat.v
            by_a, by_b, by_c = by_a + by_splat.a, by_b + by_splat.b, by_c + by_splat.c
            by_opacity += by_splat.opacity
            color[0] += by_splat.red
            color[1] += by_splat.green
            color[2] += by_splat.blue
        to_camera(row, camera, center)
        project_axes(row, camera, center, jacobian, rotation, scale, axes)
        # filtered opacity
        xx = axes[0, 0] * axes[0, 0] + axes[0, 1] * axes[0, 1] + axes[0, 2] * axes[0, 2]
        xy = axes[0, 0] * axes[1, 0] + axes[0, 1] * axes[1, 1] + axes[0, 2] * axes[1, 2]
        yy = axes[1, 0] * axes[1, 0] + axes[1, 1] * axes[1, 1] + axes[1, 2] * axes[1, 2]
        unblurred = xx * yy - xy * xy
        area = (xx + camera.blur) * (yy + camera.blur) - xy * xy
        by_xx, by_xy, by_yy = ZERO, ZERO, ZERO  # of the covariance [[xx, xy], [xy, yy]] with xy as one variable
        if unblurred / area > camera.least_share:
            by_ratio = HALF * by_opacity * splat.opacity  # d sqrt(ratio) = sqrt(ratio) / 2 d log(ratio)
            by_xx = by_ratio * (yy / unblurred - (yy + camera.blur) / area)
            by_yy = by_ratio * (xx / unblurred - (xx + camera.blur) / area)
            by_xy = -by_ratio * TWO * xy * (ONE / unblurred - ONE / area)
        sigmoid = ONE / (ONE + math.exp(-row[LOGIT]))
        out[LOGIT] = by_opacity * splat.opacity * (ONE - sigmoid)
        # covariance from its inverse Q: -Q G Q
        a, b, c, half_b = splat.a, splat.b, splat.c, HALF * by_b
        ha, hb = a * by_a + b * half_b, a * half_b + b * by_c
        hc, hd = b * by_a + c * half_b, b * half_b + c * by_c
        by_xx -= ha * a + hb * b
        by_xy -= TWO * (ha * b + hb * c)
        by_yy -= hc * b + hd * c
        half_xy = HALF * by_xy
        for j in range(3):
            by_axes[0, j] = TWO * (by_xx * axes[0, j] + half_xy * axes[1, j])
            by_axes[1, j] = TWO * (half_xy * axes[0, j] + by_yy * axes[1, j])
            out[LOG_SCALE + j] = by_axes[0, j] * axes[0, j] + by_axes[1, j] * axes[1, j]
            by_axes[0, j] *= scale[j]
            by_axes[1, j] *= scale[j]
        for i in range(3):
            for j in range(3):
                by_rotation[i, j] = jacobian[0, i] * by_axes[0, j] + jacobian[1, i] * by_axes[1, j]
            for j in range(2):
                by_jacobian[j, i] = (
                    by_axes[j, 0] * rotation[i, 0] + by_axes[j, 1] * rotation[i, 1] + by_axes[j, 2] * rotation[i, 2]
                )
        rotate_back(row, by_rotation, out)
        # center in camera coordinates, through its projection and the jacobian
        z = center[2]
        by_jxx, by_jxz, by_jyy, by_jyz = ZERO, ZERO, ZERO, ZERO
        for j in range(3):
            by_jxx += by_jacobian[0, j] * view[j]
            by_jxz += by_jacobian[0, j] * view[6 + j]
            by_jyy += by_jacobian[1, j] * view[3 + j]
            by_jyz += by_jacobian[1, j] * view[6 + j]
        inverse_square = ONE / (z * z)
        by_camera[0] = camera.fx / z * by_u - camera.fx * inverse_square * by_jxz
        by_camera[1] = camera.fy / z * by_v - camera.fy * inverse_square * by_jyz
        by_camera[2] = -(by_camera[0] * center[0] + by_camera[1] * center[1]) / z
        by_camera[2] -= (camera.fx * by_jxx + camera.fy * by_jyy) * inverse_square
        by_camera[2] += (camera.fx * center[0] * by_jxz + camera.fy * center[1] * by_jyz) * inverse_square / z
        # colors, and the center through the viewing direction
        if splat.red <= ZERO:
            color[0] = ZERO
        if splat.green <= ZERO:
            color[1] = ZERO
        if splat.blue <= ZERO:
            color[2] = ZERO
        inverse = direction(row, camera, viewdir)
        harmonics(viewdir[0], viewdir[1], viewdir[2], count, basis)
        harmonic_gradients(viewdir[0], viewdir[1], viewdir[2], count, basis_gradients)
        by_viewdir[0] = by_viewdir[1] = by_viewdir[2] = ZERO
        for k in range(count):
            along = ZERO
            for channel in range(3):
                out[COLOR + 3 * k + channel] = basis[k] * color[channel]
                along += row[COLOR + 3 * k + channel] * color[channel]
            for j in range(3):
                by_viewdir[j] += along * basis_gradients[k, j]
        along = by_viewdir[0] * viewdir[0] + by_viewdir[1] * viewdir[1] + by_viewdir[2] * viewdir[2]
        for j in range(3):
            in_world = view[j] * by_camera[0] + view[3 + j] * by_camera[1] + view[6 + j] * by_camera[2]
            out[j] = in_world + (by_viewdir[j] - along * viewdir[j]) * inverse


@kernel
def rotate_back(row, by, out):
    """Write the gradient of a row's quaternion from that of its rotation [3, 3]."""
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
