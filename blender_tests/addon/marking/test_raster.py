"""Brush, lasso and box: a pixel is marked where its center is covered; and PNG files of masks."""

import numpy as np
import pytest

Y, X = np.mgrid[0:20, 0:30] + 0.5
DENTED = [(0, 0), (30, 0), (30, 20), (20, 20), (20, 10), (10, 10), (10, 20), (0, 20)]
DRAWN = {
    "dab": ("stroke", ((10.2, 8.7), (10.2, 8.7), 4.5), np.hypot(X - 10.2, Y - 8.7) <= 4.5),
    "stroke": (
        "stroke",
        ((5, 5), (25, 5), 2),
        np.hypot(np.maximum(0, np.maximum(5 - X, X - 25)), Y - 5) <= 2,
    ),
    "lasso": (
        "polygon",
        ([(2, 2), (27, 10), (2, 18)],),
        (X > 2) & (Y - 2 > (X - 2) * 8 / 25) & (18 - Y > (X - 2) * 8 / 25),
    ),
    "lasso with a dent": ("polygon", (DENTED,), (Y < 10) | (X < 10) | (X > 20)),
    "box": ("box", ((10.5, 12.4), (3.4, 2.6)), (X > 3.4) & (X < 10.5) & (Y > 2.6) & (Y < 12.4)),
}


@pytest.mark.parametrize("tool", DRAWN)
def test_a_tool_covers_these_pixels_and_takes_them_away_again(addon, tool):
    name, arguments, wanted = DRAWN[tool]
    layer = np.zeros((20, 30), np.int8)
    getattr(addon.raster, name)(layer, *arguments, 1)
    np.testing.assert_array_equal(layer, wanted)
    getattr(addon.raster, name)(layer, *arguments, 0)
    assert not layer.any()


def test_what_lies_outside_the_photo_is_left_out(addon):
    layer = np.zeros((20, 30), np.int8)
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
    assert addon.engine_api.find_header(tmp_path / "gray.png").display_size == (6, 4)


def test_own_png_files_are_read_back_and_others_are_left_to_blender(addon, tmp_path):
    for channels in (1, 2):
        pixels = np.random.default_rng(0).integers(0, 256, (7, 5, channels)).astype(np.uint8)
        content = addon.raster.encode_png(pixels)
        np.testing.assert_array_equal(addon.raster.decode_png(content), pixels)
        for broken in (b"", content[:-5], content[:40], b"GIF" + content, content[:60] + b"?" + content[61:]):
            assert addon.raster.decode_png(broken) is None
    addon.images.write_png(tmp_path / "other.png", np.ones((4, 6, 3)))
    assert addon.raster.decode_png((tmp_path / "other.png").read_bytes()) is None
