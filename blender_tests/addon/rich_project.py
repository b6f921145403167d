"""A learned project with more to edit than the fake engine's: shades, mixed pixels and two views."""

import numpy as np

from karf_engine.palettes.color_histogram import ColorHistogram, write_object_colors
from karf_engine.palettes.compositing import Planes, write_planes
from karf_engine.palettes.palette import Palette, write_palettes
from karf_engine.project import Project
from karf_engine.project.state import result_fingerprint

LEARNED = {
    "lid": [(0, 0, 0), (0.2, 0.4, 0.7), (0.1, 0.2, 0.35), (0.95, 0.95, 0.9)],
    "pot": [(0, 0, 0), (0.8, 0.15, 0.1), (0.4, 0.08, 0.05), (0.15, 0.55, 0.2), (0.9, 0.8, 0.3)],
}
VIEWS = ("photo_0", "photo_1")
HEIGHT, WIDTH = 16, 24


def enrich(bpy, folder):
    """Give the scene's project richer palettes and two prepared views, and show the first."""
    project, karf = Project(folder), bpy.context.scene.karf
    palettes = [Palette(name, np.array(colors, np.float32)) for name, colors in LEARNED.items()]
    write_palettes(project.palette_file, palettes, shared=False)
    planes = [_planes(seed) for seed in range(len(VIEWS))]
    write_object_colors(project.object_colors_file, {name: _histogram(planes, name) for name in LEARNED})
    project.finish("palette", "rich")
    project.finish("recoloring", "rich")
    fingerprint = result_fingerprint(project.state(), "recoloring")
    for view, each in zip(VIEWS, planes, strict=True):
        write_planes(project.planes_file(view), each, fingerprint)
    karf.project = karf.project  # setting it loads the palettes
    karf.active_view = VIEWS[0]


def _planes(seed):
    """The lid on the left, the pot on the right, a gray wall between, with some noise."""
    random, columns = np.random.default_rng(seed), np.arange(WIDTH) / (WIDTH - 1)
    present = {"lid": np.clip(4 * (0.55 - columns), 0, 1), "pot": np.clip(4 * (columns - 0.45), 0, 1)}
    most = max(map(len, LEARNED.values()))
    weights = np.zeros((len(LEARNED), most, HEIGHT, WIDTH), np.float32)
    picture = np.full((HEIGHT, WIDTH, 3), 0.5)
    for own, (name, colors) in zip(weights, LEARNED.items(), strict=True):
        share = random.random((len(colors), HEIGHT, WIDTH)) ** 8
        share[random.integers(1, len(colors), (HEIGHT, WIDTH)), *np.indices((HEIGHT, WIDTH))] += 1
        own[: len(colors)] = share / share.sum(axis=0) * present[name]
        mixed = np.einsum("mhw,mc->hwc", own[: len(colors)], np.array(colors))
        picture = picture * (1 - present[name][:, None]) + mixed
    picture += random.normal(scale=0.01, size=picture.shape)
    weights = weights.astype(np.float16)
    return Planes(tuple(LEARNED), weights, weights.sum(axis=1), np.rint(picture.clip(0, 1) * 255).astype(np.uint8))


def _histogram(planes, name):
    """The colors of every third pixel that only this object covers."""
    number, count = list(LEARNED).index(name), len(LEARNED[name])
    own = [each.palette_weights[number, :count, each.probabilities[number] > 0.99] for each in planes]
    weights = np.concatenate(own).astype(np.float64)[::3]
    weights /= weights.sum(axis=1, keepdims=True)
    return ColorHistogram(weights @ np.array(LEARNED[name]), np.ones(len(weights), np.int64), weights)
