"""Reference NeRF in plain float64: networks as in their papers and programs, one ray at a time."""

import numpy as np

from karf_engine.capture.capture import View

from .still_life import cameras, take_photo


def encoded(x, n_octaves):
    values = list(x)
    for octave in range(n_octaves):
        values += list(np.sin(2**octave * np.asarray(x)))
        values += list(np.cos(2**octave * np.asarray(x)))
    return np.array(values)


def linear(state, name, x):
    return state[f"{name}.weight"] @ x + state[f"{name}.bias"]


def relu(x):
    return np.maximum(x, 0)


def vanilla(state, x, d, octaves):
    """nerf-pytorch's network: raw density, features and color at one position and direction."""
    gamma_x, gamma_d = encoded(x, octaves[0]), encoded(d, octaves[1])
    h = gamma_x
    for layer in range(8):
        h = relu(linear(state, f"pts_linears.{layer}", h))
        if layer == 4:
            h = np.concatenate([gamma_x, h])
    features = linear(state, "feature_linear", h)
    v = relu(linear(state, "views_linears.0", np.concatenate([features, gamma_d])))
    return linear(state, "alpha_linear", h)[0], features, 1 / (1 + np.exp(-linear(state, "rgb_linear", v)))


def flexible(state, x, d, octaves, n_layers, skip_every):
    """krrish94's FlexibleNeRFModel."""
    gamma_x, gamma_d = encoded(x, octaves[0]), encoded(d, octaves[1])
    h = linear(state, "layer1", gamma_x)
    for layer in range(n_layers - 1):
        if layer % skip_every == 0 and layer > 0 and layer != n_layers - 1:
            h = np.concatenate([h, gamma_x])
        h = relu(linear(state, f"layers_xyz.{layer}", h))
    features = relu(linear(state, "fc_feat", h))
    v = relu(linear(state, "layers_dir.0", np.concatenate([features, gamma_d])))
    return linear(state, "fc_alpha", h)[0], features, 1 / (1 + np.exp(-linear(state, "fc_rgb", v)))


def composited(raw, colors, t, length, ground):
    """Color of one ray, and the weights of its samples."""
    color, weights, light = np.zeros(3), [], 1.0
    for i in range(len(t)):
        delta = (t[i + 1] - t[i] if i + 1 < len(t) else 1e10) * length
        alpha = 1 - np.exp(-relu(raw[i]) * delta)
        weights.append(light * alpha)
        color += weights[-1] * colors[i]
        light *= 1 - alpha
    return color + light * ground, np.array(weights)


def fine_t(t, weights, n_fine):
    """Coarse samples and evenly spaced quantiles of their weights, sorted."""
    edges = (t[1:] + t[:-1]) / 2
    density = weights[1:-1] + 1e-5
    cdf = np.concatenate([[0], np.cumsum(density / density.sum())])
    return np.sort(np.concatenate([t, np.interp(np.linspace(0, 1, n_fine), cdf, edges)]))


def still_life(count=20, size=32, sky=False):
    photos = [take_photo(camera, sky) for camera in cameras(count, size)]
    return [View(f"v{n}", f"v{n}", photo.camera, None, "train") for n, photo in enumerate(photos)], photos
