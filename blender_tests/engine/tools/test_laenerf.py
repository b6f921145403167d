"""LAENeRF's published script, as its definition says: sums of squares of what moves."""

import numpy as np
import pytest

pytest.importorskip("scipy")
pytest.importorskip("cv2")

from blender_tests.engine.reference.textures import smooth_texture
from tools.experiments.laenerf import laenerf_error


def test_the_published_script_sums_squares_of_all_that_moves():
    first, second = smooth_texture(0), smooth_texture(3)
    assert laenerf_error(first, second, first, second) < 0.01
    assert laenerf_error(first, second, first, second + 0.1) == pytest.approx(3 * 0.1**2, abs=0.01)
    assert np.isnan(laenerf_error(first, first, first, first))
