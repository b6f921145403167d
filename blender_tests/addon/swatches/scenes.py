"""Scenes that the swatch tests recolor, and what they show."""

import numpy as np

from karf_engine.palettes.compositing import Planes

from ..prepared import write_current_planes

RED, YELLOW, GRAY = (0.8, 0.2, 0.1), (0.9, 0.9, 0.5), (0.5, 0.5, 0.5)  # the fake engine's pot is red and yellow
BLUE, GREEN = (0.1, 0.3, 0.8), (0.2, 0.7, 0.3)
LID, POT = [(0.2, 0.4, 0.6), (1, 1, 1)], [RED, YELLOW]
HEIGHT, WIDTH = 16, 24


def color(scene, name, index):
    return np.array(scene.karf.objects[name].swatches[index].color)


def colors(item):
    return np.array([swatch.color[:] for swatch in item.swatches])


def pixels(addon, scene):
    """The displayed picture from top to bottom, sRGB [H, W, 3]."""
    return addon.images.pixels(scene.karf.result)[..., :3].copy()


def levels(addon, scene):
    """The displayed picture with 8 bits."""
    return np.rint(pixels(addon, scene) * 255).astype(int)


def halves(addon, scene):
    """The central pixels of the picture's left and right half, [2, 3]."""
    return pixels(addon, scene)[8, [6, 18]]


def palettes(addon, **objects):
    """Palettes of the named objects, each with black before its colors."""
    make = addon.engine_api.Palette
    return [make(name, np.array([(0, 0, 0), *rows], np.float32)) for name, rows in objects.items()]


def show(addon, scene, weights, base, objects=("lid", "pot"), gains=(1.0, 1.0, 1.0)):
    """Give the active view a base picture [H, W, 3] and palette weights [K, M, H, W] of the objects."""
    planes = Planes(objects, weights.astype(np.float16), weights.sum(1), np.rint(255 * base).astype(np.uint8), gains)
    write_current_planes(addon, scene, planes)
    addon.displayed.forget(scene)
    addon.displayed.of(scene).refresh()


def show_halves(addon, scene):
    """Show a pot, red on the left and yellow on the right, and no lid."""
    weights, base = np.zeros((2, 3, HEIGHT, WIDTH)), np.empty((HEIGHT, WIDTH, 3))
    weights[1, 1, :, :12] = weights[1, 2, :, 12:] = 1
    base[:, :12], base[:, 12:] = RED, YELLOW
    show(addon, scene, weights, base)


def show_block(addon, scene, gains=(1.0, 1.0, 1.0), has_lid=False):
    """Show a red pot on gray, optionally with a red lid to its right, exposed by gains."""
    weights = np.zeros((2, 3, HEIGHT, WIDTH))
    weights[1, 1, 4:12, 6:18] = 1
    weights[0, 1, 4:12, 18:22] = has_lid
    show(addon, scene, weights, np.where(weights[:, 1].any(0)[..., None], RED, GRAY) * gains, gains=gains)


def set_histogram(addon, scene, palette, weights):
    """Set the counted photo colors of any object: a palette [M, 3] mixed by weights [N, M]."""
    histogram = addon.engine_api.ColorHistogram(weights @ palette, np.ones(len(weights)), weights)
    addon.displayed.of(scene).learned_histogram = lambda name: histogram
