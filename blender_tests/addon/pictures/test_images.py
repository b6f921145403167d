"""Pixels to files and back."""

import numpy as np
import pytest


def test_pixels_survive_the_way_to_a_file_and_back(addon, tmp_path):
    ramp = (np.arange(256, dtype=np.float32) / np.float32(255)).reshape(16, 16, 1).repeat(3, axis=2)
    addon.images.write_png(tmp_path / "ramp.png", ramp)
    written = addon.images.read_picture(tmp_path / "ramp.png")
    np.testing.assert_allclose(written * 255, ramp * 255, atol=1e-4)


def test_an_unreadable_picture_is_named(addon, tmp_path):
    (tmp_path / "broken.png").write_text("no picture")
    with pytest.raises(addon.engine_api.DataError, match=r"broken\.png"):
        addon.images.read_picture(tmp_path / "broken.png")


@pytest.mark.parametrize("brightest", [1, 255])
def test_a_mask_is_read_as_the_engine_reads_it(addon, tmp_path, brightest):
    mask = np.zeros((4, 6), bool)
    mask[1:3, 2:5] = True
    addon.images.write_png(tmp_path / "mask.png", mask[..., None].repeat(3, axis=-1) * brightest / 255)
    np.testing.assert_array_equal(addon.images.read_mask(tmp_path / "mask.png"), mask)


def test_a_cut_out_is_a_mask_by_its_alpha(addon, tmp_path):
    alpha = np.zeros((4, 6, 1), np.uint8)
    alpha[1:3, 2:5] = 255
    (tmp_path / "mask.png").write_bytes(addon.raster.encode_png(np.concatenate([np.zeros_like(alpha), alpha], -1)))
    np.testing.assert_array_equal(addon.images.read_mask(tmp_path / "mask.png"), alpha[..., 0] > 0)
