"""Layers of a photo at its own size: they recompose what the engine makes of the photo, however it was stored."""

from pathlib import Path

import numpy as np
import pytest

from karf_engine.io.color import linear_to_srgb, srgb_to_linear
from karf_engine.io.image_size import ImageHeader
from karf_engine.palettes.palette import Edit, Palette
from karf_engine.recolor.full_resolution import PhotoView
from karf_engine.recolor.matting.matte import Matte
from karf_engine.recolor.photos import StoredPhoto

POT = Palette("pot", np.array([[0, 0, 0], [0.9, 0.2, 0.1], [1, 0.9, 0.8]], np.float32))
MUG = Palette("mug", np.array([[0, 0, 0], [0.2, 0.3, 0.9]], np.float32))
EDIT = Edit({palette.name: palette.colors * [0.8, 1.2, 0.9] for palette in (POT, MUG)})
HEIGHT, WIDTH = 6, 9


def matte(random, rows, columns):
    height, width = rows[1] - rows[0], columns[1] - columns[0]
    coverage = (random.random((height, width)) / 2).astype(np.float16)
    mixed = np.arange(0, height * width, 3)
    return Matte(rows, columns, coverage, mixed, random.integers(0, 256, (len(mixed), 3), dtype=np.uint8))


def photo_view(kind=np.uint8, channels=3, orientation=1):
    random = np.random.default_rng(4)
    full = np.iinfo(kind).max  # colors stay away from black and white, so that no edit clips them
    pixels = random.integers(full // 4, full // 4 * 3, (HEIGHT, WIDTH, channels), dtype=kind)
    photo = StoredPhoto(Path("photo.png"), ImageHeader(WIDTH, HEIGHT, orientation, "png"), pixels)
    mattes = [matte(random, (0, 4), (1, 9)), matte(random, (2, 6), (0, 5))]
    return PhotoView(photo, orientation, ["pot", "mug"], mattes, [POT, MUG])


def recomposed(layers):
    """As a compositor does it, which has half floats in linear light."""
    base = layers.base / np.iinfo(layers.base.dtype).max if layers.base.dtype.kind == "u" else layers.base
    result = linear_to_srgb(srgb_to_linear(base).astype(np.float16).astype(np.float32))
    for palette, planes in zip(layers.palettes, layers.palette_weights, strict=True):
        for plane, change in zip(planes, EDIT.colors[palette.name] - palette.colors, strict=False):
            result = result + plane[..., None].astype(np.float32) * change
    return np.clip(result, 0, 1)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_a_turned_photo_is_upright_in_layers(orientation):
    view = photo_view(orientation=orientation)
    layers = view.layers(np.arange(6, dtype=np.float32).reshape(2, 3))
    assert layers.base.shape[:2] == ((HEIGHT, WIDTH) if orientation < 5 else (WIDTH, HEIGHT))
    assert (
        layers.coverage.shape
        == (2, *layers.base.shape[:2])
        == layers.palette_weights.shape[::2] + layers.depth.shape[1:]
    )
    np.testing.assert_allclose(recomposed(layers), view.over_white(view.recolor(EDIT)), atol=1 / 255)


@pytest.mark.parametrize("kind, channels", [(np.uint16, 3), (np.uint8, 4), (np.uint16, 4)])
def test_deep_and_transparent_photos_keep_their_look(kind, channels):
    view = photo_view(kind, channels)
    layers = view.layers(np.ones((HEIGHT, WIDTH), np.float32))
    base = view.over_white(view.photo)
    np.testing.assert_allclose(layers.base / (255 if layers.base.dtype == np.uint8 else 1), base, atol=0.51 / 255)
    np.testing.assert_allclose(recomposed(layers), view.over_white(view.recolor(EDIT)), atol=1 / 255)


def test_planes_sum_to_the_coverage_and_depth_is_never_between_two_surfaces():
    layers = photo_view().layers(np.array([[1.0, 5.0]], np.float32))
    np.testing.assert_allclose(layers.palette_weights.sum(1, dtype=np.float32), layers.coverage, atol=1e-3)
    assert set(np.unique(layers.depth)) == {1.0, 5.0}
    np.testing.assert_array_equal(layers.depth[0], [1, 1, 1, 1, 5, 5, 5, 5, 5])
