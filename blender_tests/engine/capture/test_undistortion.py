"""Photos without lens distortion, by numpy alone."""

import numpy as np
import pytest

from karf_engine.capture.camera import Camera
from karf_engine.capture.distortion import BLOCK_ROWS, undistorted

training_images = pytest.importorskip("karf_engine.capture.training_images")
LENSES = {
    "barrel": ((-0.25, 0.06, 0.002, -0.001), False),
    "pincushion": ((0.2, 0.05, 0.0, 0.0, 0.01), False),
    "fisheye": ((0.05, -0.01, 0.002, 0.0), True),
}


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())
def test_pixels_are_those_that_the_engine_learns_from(lens):
    distortion, fisheye = lens
    camera = Camera(120, BLOCK_ROWS + 40, 90.0, 95.0, 63.0, 80.0, np.eye(4), distortion, fisheye)
    photo = np.random.default_rng(0).random((camera.height, camera.width, 3), np.float32)
    expected, _, valid = training_images.undistort(photo, camera)
    found = undistorted(photo, camera)
    assert valid.mean() > 0.5
    np.testing.assert_allclose(found[valid], expected[valid], atol=1e-4)
    assert not found[~valid].any()


def test_a_pinholes_photo_stays_as_it_is():
    photo = np.random.default_rng(0).random((20, 30, 3), np.float32)
    np.testing.assert_array_equal(undistorted(photo, Camera(30, 20, 25.0, 25.0, 15.0, 10.0, np.eye(4))), photo)
