"""Brush, lasso and box: a pixel is marked where its center is covered."""

import numpy as np
import pytest


@pytest.fixture
def layer(addon):
    return np.zeros((20, 30), np.int8)


def centers(layer):
    y, x = np.mgrid[0 : layer.shape[0], 0 : layer.shape[1]] + 0.5
    return x, y


def test_a_dab_covers_its_disc(addon, layer):
    addon.raster.stroke(layer, (10.2, 8.7), (10.2, 8.7), 4.5, 1)
    x, y = centers(layer)
    np.testing.assert_array_equal(layer, np.hypot(x - 10.2, y - 8.7) <= 4.5)


def test_a_stroke_covers_all_that_is_near_its_way(addon, layer):
    addon.raster.stroke(layer, (5, 5), (25, 5), 2, 1)
    x, y = centers(layer)
    np.testing.assert_array_equal(layer, np.hypot(np.maximum(0, np.maximum(5 - x, x - 25)), y - 5) <= 2)


def test_a_stroke_takes_away_what_another_added(addon, layer):
    addon.raster.stroke(layer, (5, 5), (25, 15), 3, 1)
    addon.raster.stroke(layer, (5, 5), (25, 15), 3, 0)
    assert not layer.any()


def test_a_lasso_fills_what_it_surrounds(addon, layer):
    addon.raster.polygon(layer, [(2, 2), (27, 10), (2, 18)], 1)
    x, y = centers(layer)
    inside = (x > 2) & (y - 2 > (x - 2) * 8 / 25) & (18 - y > (x - 2) * 8 / 25)
    np.testing.assert_array_equal(layer, inside)


def test_a_lasso_with_a_dent_leaves_the_dent(addon, layer):
    addon.raster.polygon(layer, [(0, 0), (30, 0), (30, 20), (20, 20), (20, 10), (10, 10), (10, 20), (0, 20)], 1)
    assert layer[15, 15] == 0 and layer[15, 5] == layer[15, 25] == layer[5, 15] == 1
    assert layer.sum() == 500


def test_a_box_holds_the_centers_between_its_corners(addon, layer):
    addon.raster.box(layer, (10.5, 12.4), (3.4, 2.6), 1)
    x, y = centers(layer)
    np.testing.assert_array_equal(layer, (x > 3.4) & (x < 10.5) & (y > 2.6) & (y < 12.4))


def test_what_lies_outside_the_photo_is_left_out(addon, layer):
    addon.raster.stroke(layer, (-50, -50), (-40, -3), 5, 1)
    addon.raster.stroke(layer, (29, 19), (90, 90), 2, 2)
    addon.raster.box(layer, (-9, -9), (1, 1), 3)
    addon.raster.polygon(layer, [(25, -10), (60, 5), (25, 5)], 4)
    assert layer[0, 0] == 3 and layer[19, 29] == 2 and layer[2, 29] == 4
    assert set(np.unique(layer)) == {0, 2, 3, 4}


def test_png_files_are_what_other_programs_read(addon, tmp_path):
    picture = np.arange(6 * 4, dtype=np.uint8).reshape(4, 6, 1) * 10
    (tmp_path / "gray.png").write_bytes(addon.raster.encode_png(picture))
    read = addon.images.read_picture(tmp_path / "gray.png")
    np.testing.assert_allclose(read * 255, picture.repeat(3, axis=-1), atol=1e-4)
    header = addon.engine_api.find_header(tmp_path / "gray.png")
    assert header.display_size == (6, 4)


def test_own_png_files_are_read_back_and_others_are_left_to_blender(addon, tmp_path):
    for channels in (1, 2):
        pixels = np.random.default_rng(0).integers(0, 256, (7, 5, channels)).astype(np.uint8)
        content = addon.raster.encode_png(pixels)
        np.testing.assert_array_equal(addon.raster.decode_png(content), pixels)
        for broken in (b"", content[:-5], content[:40], b"GIF" + content, content[:60] + b"?" + content[61:]):
            assert addon.raster.decode_png(broken) is None
    addon.images.write_png(tmp_path / "other.png", np.ones((4, 6, 3)))
    assert addon.raster.decode_png((tmp_path / "other.png").read_bytes()) is None
