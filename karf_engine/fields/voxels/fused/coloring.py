"""Forward pass in sorted order: features and colors of the colored samples, and their sums by ray."""

from __future__ import annotations

import math

import numpy as np

from ....compute.kernels import allocating_kernel, kernel
from .arrays import BLUE, GREEN, RED
from .marching import ONE, ZERO
from .prefetching import prefetch

N_HARMONICS = 9  # per viewing direction (see rendering/rays.py)
GROUP = 4  # samples processed by the network at once
AHEAD = 12  # samples between the prefetch of a row and its use


@kernel
def gather(features, corners, x, y, z, n, out):
    """Interpolate n features in the cell of these four lower corners."""
    # unsigned indices need no test for negative ones
    a, b = np.uint64(corners[0]) * np.uint64(n), np.uint64(corners[1]) * np.uint64(n)
    c, d = np.uint64(corners[2]) * np.uint64(n), np.uint64(corners[3]) * np.uint64(n)
    wa, wb, wc, wd = (ONE - x) * (ONE - y), (ONE - x) * y, x * (ONE - y), x * y
    low = ONE - z
    for number in range(n):
        k = np.uint64(number)
        above = k + np.uint64(n)
        out[k] = low * (
            wa * features[a + k] + wb * features[b + k] + wc * features[c + k] + wd * features[d + k]
        ) + z * (
            wa * features[a + above] + wb * features[b + above] + wc * features[c + above] + wd * features[d + above]
        )


@kernel
def prefetch_rows(number, last, ordered, table, n):
    """Prefetch the corner rows of n values of the sorted sample AHEAD of this one."""
    number += AHEAD
    if number < last and ordered.points[number].importance != ZERO:
        for corner in range(4):
            start = np.int64(ordered.corners[number, corner]) * n
            prefetch(table, start)
            prefetch(table, start + n)  # upper corner


@kernel
def hidden_layers(inputs, network, out):
    """Write the hidden layer before the ReLU of GROUP inputs [GROUP, F + N_HARMONICS], reading each weight once."""
    for unit in range(out.shape[1]):
        out[0, unit] = out[1, unit] = out[2, unit] = out[3, unit] = network.b1[unit]
    for k in range(0, inputs.shape[1] // 3 * 3, 3):
        a0, b0, c0 = inputs[0, k], inputs[0, k + 1], inputs[0, k + 2]
        a1, b1, c1 = inputs[1, k], inputs[1, k + 1], inputs[1, k + 2]
        a2, b2, c2 = inputs[2, k], inputs[2, k + 1], inputs[2, k + 2]
        a3, b3, c3 = inputs[3, k], inputs[3, k + 1], inputs[3, k + 2]
        for unit in range(out.shape[1]):
            a, b, c = network.w1[k, unit], network.w1[k + 1, unit], network.w1[k + 2, unit]
            out[0, unit] += a0 * a + b0 * b + c0 * c
            out[1, unit] += a1 * a + b1 * b + c1 * c
            out[2, unit] += a2 * a + b2 * b + c2 * c
            out[3, unit] += a3 * a + b3 * b + c3 * c
    for k in range(inputs.shape[1] // 3 * 3, inputs.shape[1]):
        for member in range(GROUP):
            for unit in range(out.shape[1]):
                out[member, unit] += inputs[member, k] * network.w1[k, unit]


@kernel
def logits(features, hidden, network):
    """Return the color logits: the first three features plus the network's output."""
    red, green, blue = network.b2[0], network.b2[1], network.b2[2]
    for unit in range(len(hidden)):
        value = max(hidden[unit], ZERO)
        red += value * network.w2[0, unit]
        green += value * network.w2[1, unit]
        blue += value * network.w2[2, unit]
    return features[0] + red, features[1] + green, features[2] + blue


@kernel
def sigmoid(value):
    return ONE / (ONE + math.exp(-value))


@kernel
def next_group(number, last, ordered, group):
    """Write the next GROUP colored samples to `group`; return their count and the number after the last one."""
    count = 0
    while number < last and count < GROUP:
        if ordered.points[number].importance != ZERO:
            group[count] = number
            count += 1
        number += 1
    return count, number


@allocating_kernel
def color_samples(first, last, ordered, samples, features, harmonics, network, n_features, n_hidden, is_diffuse):
    """Compute the colors of sorted samples first to last. n_features, n_hidden: tuples of F and H elements."""
    inputs = np.zeros((GROUP, len(n_features) + N_HARMONICS), np.float32)
    hidden = np.zeros((GROUP, len(n_hidden)), np.float32)
    group = np.zeros(GROUP, np.int64)
    color_groups(
        first, last, ordered, samples, features, harmonics, network, n_features, is_diffuse, inputs, hidden, group
    )


@kernel
def color_groups(
    first, last, ordered, samples, features, harmonics, network, n_features, is_diffuse, inputs, hidden, group
):
    """Compute the colors of sorted samples in groups, in allocated arrays."""
    count, number = next_group(first, last, ordered, group)
    while count:
        for member in range(count):
            sample = group[member]
            own = ordered.features[sample]
            prefetch_rows(sample, last, ordered, features, len(n_features))
            point = ordered.points[sample]
            gather(features, ordered.corners[sample], point.x, point.y, point.z, len(n_features), own)
        if not is_diffuse:
            read_inputs(group, count, ordered, harmonics, len(n_features), inputs)
            hidden_layers(inputs, network, hidden)
        for member in range(count):
            own = ordered.features[group[member]]
            red, green, blue = own[0], own[1], own[2]
            if not is_diffuse:
                red, green, blue = logits(own, hidden[member], network)
            color = samples.colors[ordered.index[group[member]]]
            color[0], color[1], color[2] = sigmoid(red), sigmoid(green), sigmoid(blue)
        count, number = next_group(number, last, ordered, group)


@kernel
def read_inputs(group, count, ordered, harmonics, n_features, inputs):
    """Copy features and harmonics of the first `count` members of a group to `inputs`."""
    for member in range(count):
        sample = group[member]
        ray = ordered.rays[sample]
        for number in range(n_features):
            inputs[member, number] = ordered.features[sample, number]
        for number in range(N_HARMONICS):
            inputs[member, n_features + number] = harmonics[ray, number]


@kernel
def composite(first, last, rays, samples):
    """Write the sums of weighted colors of rays first to last."""
    for ray in range(first, last):
        red, green, blue = ZERO, ZERO, ZERO
        for sample in range(rays.first[ray], rays.first[ray] + rays.counts[ray]):
            weight = samples.importances[sample] * samples.light[sample].weight
            if weight != ZERO:
                red += weight * samples.colors[sample, 0]
                green += weight * samples.colors[sample, 1]
                blue += weight * samples.colors[sample, 2]
        rays.sums[ray, RED], rays.sums[ray, GREEN], rays.sums[ray, BLUE] = red, green, blue
