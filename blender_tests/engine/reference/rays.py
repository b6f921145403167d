"""Reference renderer: the formulas as float64 Python loops, ray by ray."""

import math

import numpy as np


def composite(sigmas, deltas, ray_indices, n_rays):
    """Paper Eq. 8, sample by sample: transmittance [S], ray_weights [S], final transmittance [R]."""
    light = np.ones(n_rays)
    transmittance, ray_weights = np.zeros(len(sigmas)), np.zeros(len(sigmas))
    for i, ray in enumerate(ray_indices):
        transmittance[i] = light[ray]
        alpha = -math.expm1(-float(sigmas[i]) * float(deltas[i]))
        ray_weights[i] = light[ray] * alpha
        light[ray] *= 1 - alpha
    return transmittance, ray_weights, light


def march_one(origin, viewdir, minimum, voxel, occupied, step, offset):
    """The steps of one ray through the box: distances [n], whether the cell is occupied [n], distance to a face [n].

    The steps begin where the ray enters the box (or at the origin inside it) and end where it leaves.
    """
    maximum = minimum + voxel * np.array(occupied.shape)
    near, far = 0.0, math.inf
    for axis in range(3):
        if viewdir[axis] == 0:
            if not minimum[axis] <= origin[axis] <= maximum[axis]:
                far = -1.0
            continue
        crossings = sorted((bound[axis] - origin[axis]) / viewdir[axis] for bound in (minimum, maximum))
        near, far = max(near, crossings[0]), min(far, crossings[1])
    distances, inside, clearance = [], [], []
    for number in range(10_000):
        distance = near + (number + offset) * step
        if distance >= far:
            break
        local = (origin + distance * viewdir - minimum) / voxel
        cell = np.clip(np.floor(local).astype(int), 0, np.array(occupied.shape) - 1)
        distances.append(distance)
        inside.append(bool(occupied[tuple(cell)]))
        clearance.append(min(np.abs(local - np.rint(local)).min(), (far - distance) / voxel))
    return np.array(distances), np.array(inside, bool), np.array(clearance)
