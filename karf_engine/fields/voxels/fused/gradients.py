"""Backward: from gradients of per-ray sums to those of the tables and of the color network."""

from __future__ import annotations

import numpy as np

from .arrays import ALPHA, BEFORE, BOTH, DENSITY, DISTANCE, DISTORTION, REMAINDER, SQUARE, UP_TO, Network
from .coloring import GROUP, hidden_layers, next_group, read_inputs
from .compiled import kernel
from .marching import ONE, THIRD, TWO, ZERO


@kernel
def ray_gradients(first, last, rays, samples, gradients, margin, unit, step):
    """Gradients of raw densities and of the colors' logits, in place, of the rays first to last.

    A ray's sums are linear in its weights (the distortion: quadratic). A weight's own optical depth raises it and takes
    light from all behind it, which is summed up from the back.
    """
    for ray in range(first, last):
        begin, end = rays.first[ray], rays.first[ray] + rays.counts[ray]
        upstream, reach = gradients[ray], rays.reach[ray]
        weights, moments = ZERO, rays.sums[ray, DISTANCE]
        for sample in range(begin, end):
            weights += samples.light[sample, 0]
        weights_before, moments_before = ZERO, ZERO
        for sample in range(begin, end):
            weight = samples.light[sample, 0]
            distance = samples.places[sample, 3]
            scaled = distance / unit
            moments_behind = moments - moments_before - weight * scaled
            weights_behind = weights - weights_before - weight
            apart = scaled * (weights_before - weights_behind) + moments_behind - moments_before
            gradient = TWO * upstream[DISTORTION] * (apart + step / unit * THIRD * weight)
            gradient += (upstream[DISTANCE] + upstream[SQUARE] * scaled) * scaled
            if reach >= ZERO:
                gradient += upstream[BEFORE] if distance < reach - margin else ZERO
                gradient += upstream[UP_TO] if distance < reach + margin else ZERO
            weights_before += weight
            moments_before += weight * scaled
            share = samples.shares[sample]
            if share != ZERO:
                color = samples.colors[sample]
                gradient += share * (upstream[0] * color[0] + upstream[1] * color[1] + upstream[2] * color[2])
                for channel in range(3):
                    value = color[channel]
                    color[channel] = upstream[channel] * weight * share * value * (ONE - value)
            samples.places[sample, 3] = gradient
        behind = upstream[REMAINDER] * rays.sums[ray, REMAINDER]
        for sample in range(end - 1, begin - 1, -1):
            light, gradient = samples.light[sample], samples.places[sample, 3]
            light[3] *= gradient * light[2] - behind + upstream[ALPHA] * light[1]
            behind += gradient * light[0]


@kernel
def network_gradients(inputs, hidden, logit_gradients, network, sums, hidden_gradients, input_gradients):
    """Add the gradients of GROUP samples to those of the network; fill those of their inputs [GROUP, F + 9].

    Members without a sample have logit gradients of 0, and add nothing.
    """
    n_units = hidden.shape[1]
    for member in range(GROUP):
        red, green, blue = logit_gradients[member, 0], logit_gradients[member, 1], logit_gradients[member, 2]
        for unit in range(n_units):
            value = max(hidden[member, unit], ZERO)
            gradient = red * network.w2[0, unit] + green * network.w2[1, unit] + blue * network.w2[2, unit]
            gradient = gradient if value > ZERO else ZERO
            hidden_gradients[member, unit] = gradient
            sums.b1[unit] += gradient
            sums.w2[0, unit] += red * value
            sums.w2[1, unit] += green * value
            sums.w2[2, unit] += blue * value
    for k in range(inputs.shape[1]):
        x0, x1, x2, x3 = inputs[0, k], inputs[1, k], inputs[2, k], inputs[3, k]
        total0, total1, total2, total3 = ZERO, ZERO, ZERO, ZERO
        for unit in range(n_units):
            g0, g1 = hidden_gradients[0, unit], hidden_gradients[1, unit]
            g2, g3 = hidden_gradients[2, unit], hidden_gradients[3, unit]
            sums.w1[k, unit] += x0 * g0 + x1 * g1 + x2 * g2 + x3 * g3
            weight = network.w1[k, unit]
            total0 += weight * g0
            total1 += weight * g1
            total2 += weight * g2
            total3 += weight * g3
        input_gradients[0, k], input_gradients[1, k] = total0, total1
        input_gradients[2, k], input_gradients[3, k] = total2, total3
    for member in range(GROUP):
        for channel in range(3):
            sums.b2[channel] += logit_gradients[member, channel]
            input_gradients[member, channel] += logit_gradients[member, channel]


@kernel
def add_at(table, row, low, high, n, values):
    """Add low * values to a row of n and high * values to the next one."""
    at = np.uint64(row) * np.uint64(n)
    for number in range(n):
        k = at + np.uint64(number)
        table[k] += low * values[number]
        table[k + np.uint64(n)] += high * values[number]


@kernel
def corner_shares(place):
    """What each of a cell's four lower corners counts for, and the upper ones' part of it."""
    x, y = place[0], place[1]
    return ((ONE - x) * (ONE - y), (ONE - x) * y, x * (ONE - y), x * y), place[2]


@kernel
def slab_gradients(
    first, last, offset, cuts, ordered, samples, harmonics, network, gradients, touched, sums, n_features,
    n_hidden, is_diffuse,
):  # fmt: skip
    """Gradients of the slabs number offset + 2 * (first to last): no two of these share a vertex.

    The network's are summed by slab. Which thread takes which slab is chance, and changes no bit.
    """
    inputs = np.zeros((GROUP, len(n_features) + 9), np.float32)
    input_gradients, logit_gradients = np.zeros_like(inputs), np.zeros((GROUP, 3), np.float32)
    hidden = np.zeros((GROUP, len(n_hidden)), np.float32)
    hidden_gradients = np.zeros_like(hidden)
    group = np.zeros(GROUP, np.int64)
    for pair in range(first, last):
        slab = offset + 2 * pair
        own_sums = Network(sums.w1[slab], sums.b1[slab], sums.w2[slab], sums.b2[slab])
        density_gradients(cuts[slab], cuts[slab + 1], ordered, samples, gradients[0], touched)
        count, number = next_group(cuts[slab], cuts[slab + 1], ordered, group)
        while count:
            logit_gradients[:] = ZERO
            for member in range(count):
                logit_gradients[member] = samples.colors[ordered.index[group[member]]]
            if is_diffuse:
                input_gradients[:, :3] = logit_gradients
            else:
                read_inputs(group, count, ordered, harmonics, len(n_features), inputs)
                hidden_layers(inputs, network, hidden)
                network_gradients(inputs, hidden, logit_gradients, network, own_sums, hidden_gradients, input_gradients)
            for member in range(count):
                corners = ordered.corners[group[member]]
                shares, upper = corner_shares(ordered.places[group[member]])
                for corner in range(4):
                    low, high = shares[corner] * (ONE - upper), shares[corner] * upper
                    add_at(gradients[1], corners[corner], low, high, len(n_features), input_gradients[member])
            count, number = next_group(number, cuts[slab + 1], ordered, group)


@kernel
def density_gradients(first, last, ordered, samples, gradients, touched):
    """Gradients of raw densities, of the ordered samples first to last, and which rows they touch."""
    for number in range(first, last):
        place = ordered.places[number]
        corners = ordered.corners[number]
        shares, upper = corner_shares(place)
        gradient = samples.light[ordered.index[number], 3]
        flag = DENSITY if place[3] == ZERO else BOTH
        for corner in range(4):
            row = np.uint64(corners[corner])
            gradients[row] += shares[corner] * (ONE - upper) * gradient
            gradients[row + np.uint64(1)] += shares[corner] * upper * gradient
            touched[row] |= flag
            touched[row + np.uint64(1)] |= flag
