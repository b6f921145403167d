"""A dark paint becomes a bright one, and the photo keeps the grain that it was taken with."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from karf_engine.io.image_size import ImageHeader
from karf_engine.palettes.palette import Edit, Palette
from karf_engine.recolor.full_resolution import PhotoView, denoise, estimate_noise
from karf_engine.recolor.matting.matte import Matte
from karf_engine.recolor.photos import StoredPhoto

GRAIN = 2.0  # 1/255
NAVY = Palette("jacket", np.array([[0, 0, 0], [0.12, 0.14, 0.3], [0.9, 0.9, 1]], np.float32))
ORANGE = Edit({"jacket": np.array([[0, 0, 0], [1.2, 0.5, 0.1], [1, 0.95, 0.9]], np.float32)})
SIDE = 64


def photo_view(kind):
    """A navy jacket, lit from the left, with a sharp white button."""
    shading = np.linspace(1, 0.4, SIDE)[None, :, None]
    clean = np.broadcast_to(shading * NAVY.colors[1], (SIDE, SIDE, 3)).copy()
    clean[20:30, 20:30] = 0.85
    grainy = clean + np.random.default_rng(0).normal(0, GRAIN / 255, clean.shape)
    full = np.iinfo(kind).max
    pixels = np.rint(np.clip(grainy, 0, 1) * full).astype(kind)
    photo = StoredPhoto(Path("photo.png"), ImageHeader(SIDE, SIDE, 1, "png"), pixels)
    whole = Matte((0, SIDE), (0, SIDE), np.ones((SIDE, SIDE), np.float16), np.zeros(0, int), np.zeros((0, 3), np.uint8))
    return PhotoView(photo, 1, ["jacket"], [whole], [NAVY], grain=estimate_noise(photo.over_white()))


def finest_details(picture):
    """Of the cloth, without the button, 1/255."""
    cloth = picture[34:] * 255
    return ((cloth[1:, 1:] - cloth[:-1, 1:] - cloth[1:, :-1] + cloth[:-1, :-1]) / 2).std()


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_a_dark_paint_that_becomes_a_bright_one_has_the_photos_own_grain(kind):
    view = photo_view(kind)
    before = finest_details(view.over_white(view.photo))
    amplified = finest_details(view.over_white(replace(view, grain=0.0).recolor(ORANGE)))
    kept = finest_details(view.over_white(view.recolor(ORANGE)))
    assert amplified > 2 * before
    assert 0.7 * before < kept < 1.3 * before


def test_what_is_sharp_stays_sharp():
    view = photo_view(np.uint8)
    recolored = view.over_white(view.recolor(ORANGE))
    assert recolored[25, 19].min() < 0.4 < 0.7 < recolored[25, 20].min()


def test_an_edit_that_changes_nothing_changes_no_bit():
    view = photo_view(np.uint8)
    same = view.recolor(Edit({"jacket": NAVY.colors}))
    np.testing.assert_array_equal(same.pixels, view.photo.pixels)


def test_bands_of_rows_join_without_a_seam(monkeypatch):
    view = photo_view(np.uint8)
    whole = view.recolor(ORANGE).pixels
    monkeypatch.setattr("karf_engine.recolor.full_resolution.BAND_PIXELS", 7 * SIDE)
    np.testing.assert_array_equal(view.recolor(ORANGE).pixels, whole)


def test_grain_is_measured_beside_texture_and_there_is_none_in_a_drawing():
    columns = np.arange(SIDE)
    drawing = np.broadcast_to(np.where(columns // 8 % 2, 200.0, 50.0)[None, :, None], (SIDE, SIDE, 3))
    assert estimate_noise(drawing) == 0
    assert denoise(drawing, 0.0) is drawing
    grainy = drawing + np.random.default_rng(1).normal(0, GRAIN, drawing.shape)
    assert estimate_noise(grainy) == pytest.approx(GRAIN, rel=0.15)
