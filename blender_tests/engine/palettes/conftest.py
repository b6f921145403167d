"""Objects of known paint, and their colors after an edit."""

import numpy as np

from karf_engine.io.color import linear_to_srgb, srgb_to_linear
from karf_engine.palettes.color_histogram import ColorHistogram
from karf_engine.palettes.palette_weights import star_weights

RED, GREEN, BLUE, YELLOW, CREAM, VIOLET = np.array(
    [(0.7, 0.1, 0.1), (0.1, 0.5, 0.2), (0.1, 0.2, 0.7), (0.9, 0.75, 0.1), (0.85, 0.8, 0.65), (0.5, 0.2, 0.6)]
)
LEGO = np.array([(0, 0, 0), (255, 252, 61), (255, 144, 6), (71, 92, 130), (255, 0, 0), (255, 255, 255)]) / 255


def lit(paint, count=20):
    """Shades of a matt paint from dark to light, sRGB [count, 3]."""
    return linear_to_srgb(np.linspace(0.1, 1, count)[:, None] * srgb_to_linear(paint))


def glossy_sphere(paint, gloss=0.5, stripes=None):
    """Pixels of a lit sphere, rounded to bytes, sRGB [n, 3]; `stripes`: the paint of every other band."""
    normal, is_paint = sphere_normals()
    light = np.array([0.4, 0.6, 0.7]) / np.linalg.norm([0.4, 0.6, 0.7])
    half = (light + [0, 0, 1]) / np.linalg.norm(light + [0, 0, 1])
    shading = 0.25 + 0.75 * np.maximum(normal @ light, 0)
    highlights = gloss * np.maximum(normal @ half, 0) ** 40
    albedo = srgb_to_linear(paint if stripes is None else np.where(is_paint[:, None], paint, stripes))
    return np.rint(255 * linear_to_srgb(np.clip(albedo * shading[:, None] + highlights[:, None], 0, 1))) / 255


def sphere_normals():
    """Normals of the sphere's pixels [n, 3], and which pixels lie outside the stripes."""
    y, x = np.mgrid[1:-1:64j, -1:1:64j]
    inside = x * x + y * y < 0.95
    normal = np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0))], axis=-1)[inside]
    return normal, np.floor(normal[:, 1] * 5) % 2 == 0


def histogram_of(colors, palette):
    """The histogram of an object with one pixel of each color."""
    return ColorHistogram(colors, np.ones(len(colors)), star_weights(colors, palette))


def recolor(seen, palette, edited):
    """The object's colors with an edited palette, sRGB [n, 3]."""
    return np.clip(seen.colors + seen.palette_weights @ (edited - palette), 0, 1)
