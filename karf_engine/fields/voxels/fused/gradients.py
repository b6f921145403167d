"""Backward pass: from gradients of the ray sums to those of the tables and the color network; total variation."""

import numpy as np

from ....compute.kernels import allocating_kernel, kernel, literal_kernel
from .arrays import BOTH, DENSITY, ONE, THIRD, TWO, ZERO, Network, prefetch
from .coloring import GROUP, N_HARMONICS, hidden_layers, next_group, prefetch_rows, read_inputs

BLOCK_PAIRS = 2048  # pairs of rows per partial sum, so that sums do not depend on the threads
PAIRS_AHEAD = 8  # pairs between the prefetch of a row and its use


@kernel
def ray_gradients(first, last, rays, samples, gradients, margin, unit, step):
    """Write the sample gradients of rays first to last, from the gradients of their sums.

    The sums are linear in the ray weights, the distortion quadratic. With optical depths d and transmittances T after
    each sample, dw_i/dd_i = T_i and dw_j/dd_i = -w_j for j > i, accumulated from the last sample.
    """
    for ray in range(first, last):
        begin, end = rays.first[ray], rays.first[ray] + rays.counts[ray]
        upstream, reach = gradients[ray], rays.reach[ray]
        weights, moments = ZERO, rays.sums[ray].distance
        for sample in range(begin, end):
            weights += samples.light[sample].weight
        weights_before, moments_before = ZERO, ZERO
        for sample in range(begin, end):
            weight = samples.light[sample].weight
            distance = samples.points[sample].distance
            scaled = distance / unit
            moments_behind = moments - moments_before - weight * scaled
            weights_behind = weights - weights_before - weight
            apart = scaled * (weights_before - weights_behind) + moments_behind - moments_before
            gradient = TWO * upstream.distortion * (apart + step / unit * THIRD * weight)
            gradient += (upstream.distance + upstream.square * scaled) * scaled
            if reach >= ZERO:
                gradient += upstream.before if distance < reach - margin else ZERO
                gradient += upstream.up_to if distance < reach + margin else ZERO
            weights_before += weight
            moments_before += weight * scaled
            importance = samples.importances[sample]
            if importance != ZERO:
                color = logit_gradients = samples.colors[sample]  # overwritten in place
                along_color = upstream.red * color[0] + upstream.green * color[1] + upstream.blue * color[2]
                gradient += importance * along_color
                red, green, blue = color[0], color[1], color[2]
                logit_gradients[0] = upstream.red * weight * importance * red * (ONE - red)
                logit_gradients[1] = upstream.green * weight * importance * green * (ONE - green)
                logit_gradients[2] = upstream.blue * weight * importance * blue * (ONE - blue)
            samples.weight_gradients[sample] = gradient
        after = upstream.final_transmittance * rays.sums[ray].final_transmittance
        for sample in range(end - 1, begin - 1, -1):
            light, gradient = samples.light[sample], samples.weight_gradients[sample]
            by_depth = gradient * light.transmittance - after + upstream.alpha * light.transparency
            samples.density_gradients[sample] = light.depth_gradient * by_depth
            after += gradient * light.weight


@kernel
def network_gradients(inputs, n_features, hidden, logit_gradients, network, sums, hidden_gradients, feature_gradients):
    """Add the network gradients of GROUP samples to `sums`; write those of their features [GROUP, F].

    Unused members of the group have logit gradients of 0.
    """
    n_units = hidden.shape[1]
    red, green, blue = logit_gradients[:, 0], logit_gradients[:, 1], logit_gradients[:, 2]
    red0, red1, red2, red3 = red[0], red[1], red[2], red[3]
    green0, green1, green2, green3 = green[0], green[1], green[2], green[3]
    blue0, blue1, blue2, blue3 = blue[0], blue[1], blue[2], blue[3]
    for unit in range(n_units):  # all members at once, to read and write the sums once
        r, g, b = network.w2[0, unit], network.w2[1, unit], network.w2[2, unit]
        value0, value1 = max(hidden[0, unit], ZERO), max(hidden[1, unit], ZERO)
        value2, value3 = max(hidden[2, unit], ZERO), max(hidden[3, unit], ZERO)
        gradient0 = red0 * r + green0 * g + blue0 * b if value0 > ZERO else ZERO
        gradient1 = red1 * r + green1 * g + blue1 * b if value1 > ZERO else ZERO
        gradient2 = red2 * r + green2 * g + blue2 * b if value2 > ZERO else ZERO
        gradient3 = red3 * r + green3 * g + blue3 * b if value3 > ZERO else ZERO
        hidden_gradients[0, unit], hidden_gradients[1, unit] = gradient0, gradient1
        hidden_gradients[2, unit], hidden_gradients[3, unit] = gradient2, gradient3
        sums.b1[unit] += gradient0 + gradient1 + gradient2 + gradient3
        sums.w2[0, unit] += red0 * value0 + red1 * value1 + red2 * value2 + red3 * value3
        sums.w2[1, unit] += green0 * value0 + green1 * value1 + green2 * value2 + green3 * value3
        sums.w2[2, unit] += blue0 * value0 + blue1 * value1 + blue2 * value2 + blue3 * value3
    for k in range(n_features):
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
        feature_gradients[0, k], feature_gradients[1, k] = total0, total1
        feature_gradients[2, k], feature_gradients[3, k] = total2, total3
    for k in range(n_features, inputs.shape[1]):
        x0, x1, x2, x3 = inputs[0, k], inputs[1, k], inputs[2, k], inputs[3, k]
        for unit in range(n_units):
            g0, g1 = hidden_gradients[0, unit], hidden_gradients[1, unit]
            g2, g3 = hidden_gradients[2, unit], hidden_gradients[3, unit]
            sums.w1[k, unit] += x0 * g0 + x1 * g1 + x2 * g2 + x3 * g3
    for member in range(GROUP):
        for channel in range(3):
            sums.b2[channel] += logit_gradients[member, channel]
            feature_gradients[member, channel] += logit_gradients[member, channel]


@kernel
def add_to_rows(table, row, low, high, n, values):
    """Add low * values to a row of n values and high * values to the next row."""
    start = np.uint64(row) * np.uint64(n)
    for number in range(n):
        k = start + np.uint64(number)
        table[k] += low * values[number]
        table[k + np.uint64(n)] += high * values[number]


@kernel
def corner_weights(point):
    """Return the bilinear weights of a cell's four lower corners, and the fraction of the upper ones."""
    x, y = point.x, point.y
    return ((ONE - x) * (ONE - y), (ONE - x) * y, x * (ONE - y), x * y), point.z


@allocating_kernel
def slab_gradients(
    first, last, offset, cuts, ordered, samples, harmonics, network, gradients, touched, sums,
    n_features, n_hidden, is_diffuse,
):  # fmt: skip
    """Add the gradients of slabs offset + 2 * (first to last), which share no vertex.

    The network gradients are summed by slab, so the result does not depend on the threads.
    """
    workspace = (  # of the color network, for GROUP samples at a time
        np.zeros((GROUP, len(n_features) + N_HARMONICS), np.float32),  # inputs
        np.zeros((GROUP, len(n_features)), np.float32),  # gradients of features
        np.zeros((GROUP, 3), np.float32),  # gradients of logits
        np.zeros((GROUP, len(n_hidden)), np.float32),  # hidden layer before the ReLU
        np.zeros((GROUP, len(n_hidden)), np.float32),  # its gradients
        np.zeros(GROUP, np.int64),  # numbers of the sorted samples
    )
    for pair in range(first, last):
        slab = offset + 2 * pair
        own_sums = Network(sums.w1[slab], sums.b1[slab], sums.w2[slab], sums.b2[slab])
        slab_gradients_in(
            workspace, cuts[slab], cuts[slab + 1], ordered, samples, harmonics, network, gradients, touched,
            own_sums, n_features, is_diffuse,
        )  # fmt: skip


@kernel
def slab_gradients_in(
    workspace, first, last, ordered, samples, harmonics, network, gradients, touched, sums, n_features,
    is_diffuse,
):  # fmt: skip
    """Add the gradients of the slab of sorted samples first to last."""
    inputs, feature_gradients, logit_gradients, hidden, hidden_gradients, group = workspace
    density_gradients(first, last, ordered, samples, gradients.densities, touched)
    count, number = next_group(first, last, ordered, group)
    while count:
        logit_gradients[:] = ZERO
        for member in range(count):
            for channel in range(3):
                gradient = samples.colors[ordered.index[group[member]], channel]
                logit_gradients[member, channel] = feature_gradients[member, channel] = gradient
        if not is_diffuse:
            read_inputs(group, count, ordered, harmonics, len(n_features), inputs)
            hidden_layers(inputs, network, hidden)
            network_gradients(
                inputs, len(n_features), hidden, logit_gradients, network, sums, hidden_gradients, feature_gradients
            )
        for member in range(count):
            prefetch_rows(group[member], last, ordered, gradients.features, len(n_features))
            corners = ordered.corners[group[member]]
            weights, upper = corner_weights(ordered.points[group[member]])
            for corner in range(4):
                low, high = weights[corner] * (ONE - upper), weights[corner] * upper
                add_to_rows(gradients.features, corners[corner], low, high, len(n_features), feature_gradients[member])
        count, number = next_group(number, last, ordered, group)


@kernel
def density_gradients(first, last, ordered, samples, gradients, touched):
    """Add the gradients of raw densities of sorted samples first to last, and flag the touched rows."""
    for number in range(first, last):
        point = ordered.points[number]
        corners = ordered.corners[number]
        weights, upper = corner_weights(point)
        gradient = samples.density_gradients[ordered.index[number]]
        flag = DENSITY if point.importance == ZERO else BOTH
        for corner in range(4):
            row = np.uint64(corners[corner])
            gradients[row] += weights[corner] * (ONE - upper) * gradient
            gradients[row + np.uint64(1)] += weights[corner] * upper * gradient
            touched[row] |= flag
            touched[row + np.uint64(1)] |= flag


@kernel
def difference_sums(first, last, rows, other_rows, density, features, n_features, sums):
    """Write sums [blocks, 2] of squared differences of densities and features; pairs with a row of -1 are skipped."""
    for block in range(first, last):
        density_sum, feature_sum = 0.0, 0.0
        for pair in range(block * BLOCK_PAIRS, min(len(rows), (block + 1) * BLOCK_PAIRS)):
            prefetch_pair(pair, rows, other_rows, features, len(n_features))
            one, other = rows[pair], other_rows[pair]
            if one < 0 or other < 0:
                continue
            density_sum += (density[other] - density[one]) ** 2
            a = np.uint64(one) * np.uint64(len(n_features))
            b = np.uint64(other) * np.uint64(len(n_features))
            total = ZERO
            for number in range(len(n_features)):
                k = np.uint64(number)
                total += (features[b + k] - features[a + k]) ** 2
            feature_sum += total
        sums[block, 0], sums[block, 1] = density_sum, feature_sum


@kernel
def prefetch_pair(pair, rows, other_rows, table, n):
    """Prefetch both rows of n values of the pair PAIRS_AHEAD of this one."""
    pair += PAIRS_AHEAD
    if pair < len(rows):
        prefetch(table, np.int64(rows[pair]) * n)
        prefetch(table, np.int64(other_rows[pair]) * n)


@kernel
def difference_gradients(
    first, last, rows, other_rows, values, gradients, n_features, touched, density_factor, feature_factor
):
    """Add the gradients of both sums, times their factors, to table rows first to last."""
    for pair in range(len(rows)):
        one, other = rows[pair], other_rows[pair]
        if one < 0 or other < 0:
            continue
        has_one, has_other = first <= one < last, first <= other < last
        if has_one and has_other:
            prefetch_pair(pair, rows, other_rows, values.features, len(n_features))
            prefetch_pair(pair, rows, other_rows, gradients.features, len(n_features))
        if has_one:
            add_row_gradient(one, other, values, gradients, n_features, touched, density_factor, feature_factor)
        if has_other:
            add_row_gradient(other, one, values, gradients, n_features, touched, density_factor, feature_factor)


@literal_kernel
def add_row_gradient(row, other, values, gradients, n_features, touched, density_factor, feature_factor):
    """Add the gradients of one pair to the first row alone; another thread may own the other one."""
    touched[row] = BOTH
    gradients.densities[row] -= TWO * density_factor * (values.densities[other] - values.densities[row])
    a = np.uint64(row) * np.uint64(len(n_features))
    b = np.uint64(other) * np.uint64(len(n_features))
    for number in range(len(n_features)):
        k = np.uint64(number)
        gradients.features[a + k] -= TWO * feature_factor * (values.features[b + k] - values.features[a + k])
