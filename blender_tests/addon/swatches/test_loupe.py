"""The loupe shows the pixels under the mouse, at the picture's border too."""

import numpy as np


def test_the_pixels_round_a_place(addon):
    picture = np.zeros((40, 60, 3), np.uint8)
    picture[10, 20] = (255, 0, 0)
    seen = addon.overlays.pixels_at(picture, (20.5 / 60, 1 - 10.5 / 40))
    middle = addon.overlays.LOUPE_SIDE // 2
    assert seen.shape == (addon.overlays.LOUPE_SIDE, addon.overlays.LOUPE_SIDE, 3)
    np.testing.assert_array_equal(np.argwhere(seen[..., 0]), [[middle, middle]])


def test_beyond_the_border_it_is_continued(addon):
    picture = np.arange(40 * 60 * 3).reshape(40, 60, 3).astype(np.uint8)
    seen = addon.overlays.pixels_at(picture, (0.0, 1.0)) * 255
    np.testing.assert_allclose(seen[0, 0], picture[0, 0], atol=1e-4)
    np.testing.assert_allclose(
        seen[-1, -1], picture[addon.overlays.LOUPE_SIDE // 2, addon.overlays.LOUPE_SIDE // 2], atol=1e-4
    )
