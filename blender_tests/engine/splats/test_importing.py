"""Gaussians of another program tell a field where its surface is."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

pytest.importorskip("numba")

from blender_tests.engine.splats.clouds import ball, camera_ahead
from karf_engine.errors import Cancelled
from karf_engine.splats.gaussians import imported_gaussians
from karf_engine.splats.kernels.arrays import ANTIALIASED_FILTER, LOG_SCALE, PLAIN_FILTER
from karf_engine.splats.visibility import AT_INFINITY, sample_surface_points

CAMERAS = [camera_ahead(80, 60, 80.0), camera_ahead(40, 30, 40.0)]


def wall(z=0.0, reach=6.0, size=0.1):
    """Flat Gaussians close together across z."""
    steps = np.arange(-reach, reach, size)
    table = np.stack([ball((x, y, z), size, 0.99, (0.8, 0.2, 0.1)) for x in steps for y in steps])
    table[:, LOG_SCALE + 2] = np.log(0.001)
    return table


@pytest.mark.parametrize(("is_antialiased", "expected"), [(False, PLAIN_FILTER), (True, ANTIALIASED_FILTER)])
def test_they_are_shown_as_they_were_learned_over_black(is_antialiased, expected):
    gaussians = imported_gaussians(wall(), is_antialiased, CAMERAS)
    assert gaussians.screen_filter == expected and gaussians.background == (0, 0, 0) and gaussians.n_background == 0
    assert 0.01 < gaussians.near < 0.2


def test_points_lie_on_what_cameras_see_with_all_cameras_that_see_them():
    points = sample_surface_points(imported_gaussians(wall(), False, CAMERAS), CAMERAS)
    assert len(points) > 1000
    assert_allclose(points.positions[:, 2], 0, atol=0.02)
    assert_allclose(np.median(points.colors, 0), 255 * np.array([0.8, 0.2, 0.1]), atol=8)
    assert (np.bincount(points.point, minlength=len(points)) == 2).mean() > 0.95
    for number, camera in enumerate(CAMERAS):
        pixels, _ = camera.project(points.positions[points.point[points.view == number]])
        assert_allclose(points.pixels[points.view == number], pixels, atol=1e-3)


def test_what_is_hidden_from_a_camera_is_not_its_observation():
    """A small wall near the first camera hides the far one from it; the second camera stands behind the small one."""
    behind = camera_ahead(80, 60, 80.0)
    behind.camera_to_world[2, 3] = 1
    gaussians = imported_gaussians(np.concatenate([wall(), wall(2.0, 1.0)]), False, [CAMERAS[0], behind])
    points = sample_surface_points(gaussians, [CAMERAS[0], behind])
    pixels, _ = CAMERAS[0].project(points.positions)
    far = (points.positions[:, 2] < 1) & (np.abs(pixels - (40, 30)) < 20).all(1)
    assert far.sum() > 50 and not np.isin(points.point[points.view == 0], np.flatnonzero(far)).any()


def test_neither_haze_nor_the_sky_gives_points():
    haze = wall()
    haze[:, 10] = -4.0
    assert len(sample_surface_points(imported_gaussians(haze, False, CAMERAS), CAMERAS)) == 0
    sky = wall(4 - 4 * 2 * AT_INFINITY, 60 * AT_INFINITY / 8, 2.0)
    points = sample_surface_points(imported_gaussians(np.concatenate([wall(reach=1.2), sky]), False, CAMERAS), CAMERAS)
    assert len(points) and (points.positions[:, 2] > -1).all()


def test_looking_can_be_cancelled():
    def stop():
        raise Cancelled("stop", "")

    with pytest.raises(Cancelled):
        sample_surface_points(imported_gaussians(wall(), False, CAMERAS), CAMERAS, stop)
