"""Marks at the border of a photo, and PNG files of masks."""

import numpy as np


def test_marks_outside_the_photo_are_clipped(addon):
    layer = np.zeros((20, 30), np.int8)
    addon.raster.stroke(layer, (-50, -50), (-40, -3), 5, 1)
    addon.raster.stroke(layer, (29, 19), (90, 90), 2, 2)
    addon.raster.box(layer, (-9, -9), (1, 1), 3)
    addon.raster.polygon(layer, [(25, -10), (60, 5), (25, 5)], 4)
    assert layer[0, 0] == 3 and layer[19, 29] == 2 and layer[2, 29] == 4
    assert set(np.unique(layer)) == {0, 2, 3, 4}


def test_png_files_are_readable_by_other_programs(addon, tmp_path):
    picture = np.arange(6 * 4, dtype=np.uint8).reshape(4, 6, 1) * 10
    (tmp_path / "gray.png").write_bytes(addon.raster.encode_png(picture))
    read = addon.images.read_picture(tmp_path / "gray.png")
    np.testing.assert_allclose(read * 255, picture.repeat(3, axis=-1), atol=1e-4)
    assert addon.engine_api.find_header(tmp_path / "gray.png").display_size == (6, 4)


def test_own_png_files_are_read_back_and_others_left_to_blender(addon, tmp_path):
    for channels in (1, 2):
        pixels = np.random.default_rng(0).integers(0, 256, (7, 5, channels)).astype(np.uint8)
        content = addon.raster.encode_png(pixels)
        np.testing.assert_array_equal(addon.raster.decode_png(content), pixels)
        for broken in (b"", content[:-5], content[:40], b"GIF" + content, content[:60] + b"?" + content[61:]):
            assert addon.raster.decode_png(broken) is None
    addon.images.write_png(tmp_path / "other.png", np.ones((4, 6, 3)))
    assert addon.raster.decode_png((tmp_path / "other.png").read_bytes()) is None
