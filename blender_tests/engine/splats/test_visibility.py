"""What photos show of Gaussians: points on surfaces, and from where each is known; all else fades into gray."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

pytest.importorskip("numba")

from blender_tests.engine.splats.clouds import BACKGROUND, NEAR, ball, camera_ahead, cloud
from karf_engine.errors import Cancelled
from karf_engine.splats.gaussians import Gaussians, imported_gaussians
from karf_engine.splats.kernels.arrays import ANTIALIASED_FILTER, LOG_SCALE, PLAIN_FILTER
from karf_engine.splats.rasterizer import UNKNOWN_COLOR, rasterize
from karf_engine.splats.visibility import AT_INFINITY, confidence_from, sample_surface_points, visibility_in_photos

CAMERAS = [camera_ahead(80, 60, 80.0), camera_ahead(40, 30, 40.0)]
ABOVE = np.array([0.0, 0.0, 4.0])


# ----------------------------------------------------------------------------------------------------------------- points
def wall(z=0.0, reach=6.0, size=0.1):
    steps = np.arange(-reach, reach, size)
    table = np.stack([ball((x, y, z), size, 0.99, (0.8, 0.2, 0.1)) for x in steps for y in steps])
    table[:, LOG_SCALE + 2] = np.log(0.001)
    return table


def points_of(*tables, cameras=CAMERAS, check=lambda: None):
    return sample_surface_points(imported_gaussians(np.concatenate(tables), False, cameras), cameras, check)


@pytest.mark.parametrize(("is_antialiased", "expected"), [(False, PLAIN_FILTER), (True, ANTIALIASED_FILTER)])
def test_imported_gaussians_keep_their_screen_filter(is_antialiased, expected):
    gaussians = imported_gaussians(wall(), is_antialiased, CAMERAS)
    assert gaussians.screen_filter == expected and gaussians.background == (0, 0, 0) and gaussians.n_background == 0
    assert 0.01 < gaussians.near < 0.2


def test_points_lie_on_visible_surfaces_and_name_their_cameras():
    points = points_of(wall())
    assert len(points) > 1000
    assert_allclose(points.positions[:, 2], 0, atol=0.02)
    assert_allclose(np.median(points.colors, 0), 255 * np.array([0.8, 0.2, 0.1]), atol=8)
    assert (np.bincount(points.point, minlength=len(points)) == 2).mean() > 0.95
    for number, camera in enumerate(CAMERAS):
        pixels, _ = camera.project(points.positions[points.point[points.view == number]])
        assert_allclose(points.pixels[points.view == number], pixels, atol=1e-3)


def test_hidden_points_are_not_observed():
    """A small wall near the first camera hides the far one from it; the second camera stands behind the small one."""
    behind = camera_ahead(80, 60, 80.0)
    behind.camera_to_world[2, 3] = 1
    points = points_of(wall(), wall(2.0, 1.0), cameras=[CAMERAS[0], behind])
    pixels, _ = CAMERAS[0].project(points.positions)
    far = (points.positions[:, 2] < 1) & (np.abs(pixels - (40, 30)) < 20).all(1)
    assert far.sum() > 50 and not np.isin(points.point[points.view == 0], np.flatnonzero(far)).any()


def test_haze_and_sky_give_no_points():
    haze = wall()
    haze[:, 10] = -4.0
    assert len(points_of(haze)) == 0
    points = points_of(wall(reach=1.2), wall(4 - 4 * 2 * AT_INFINITY, 60 * AT_INFINITY / 8, 2.0))
    assert len(points) and (points.positions[:, 2] > -1).all()


def test_looking_can_be_cancelled():
    def stop():
        raise Cancelled("stop", "")

    with pytest.raises(Cancelled):
        points_of(wall(), check=stop)


# ------------------------------------------------------------------------------------------------------------- confidence
def camera_turned(degrees):
    """The camera ahead, turned about the x axis through the origin."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.eye(4)
    turn[1:3, 1:3] = [[c, -s], [s, c]]
    camera = camera_ahead()
    return replace(camera, camera_to_world=turn @ camera.camera_to_world)


def looked_at(rows, degrees):
    found = Gaussians(np.stack(rows), 0, BACKGROUND, NEAR)
    return replace(found, visibility=visibility_in_photos(found, [camera_turned(each) for each in degrees]))


def test_confidence_falls_away_from_the_photos_directions():
    found = looked_at([ball()], (-20, 0, 20))
    from_degrees = [float(confidence_from(found, camera_turned(each).position)[0]) for each in (0, 20, 29, 45, 61, 180)]
    assert from_degrees[:3] == [1, 1, 1] and from_degrees[4:] == [0, 0]
    assert 0 < from_degrees[3] < 1
    assert confidence_from(looked_at([ball()], (0,)), ABOVE)[0] == 0.5, "one photo alone tells half"


def test_gaussians_that_no_photo_shows_have_no_confidence():
    hidden, beside = ball((0, 0, -1), size=0.02), ball((9, 0, 0))
    found = looked_at([ball(opacity=0.999, size=0.5), ball((0, 0, 0.1), 0.5, 0.999), hidden, beside], (-3, 3))
    for eye in (ABOVE, -ABOVE):
        assert_array_equal(confidence_from(found, eye)[2:], [0, 0])
    assert_array_equal(confidence_from(found, ABOVE)[:2], [1, 1])


def test_the_unknown_is_gray_and_the_known_keeps_its_bits():
    found = Gaussians(cloud(), 0, BACKGROUND, NEAR)
    camera, sure = camera_ahead(), np.ones(len(found), np.float32)
    plain = rasterize(found, camera)
    assert_array_equal(rasterize(found, camera, sure).image, plain.image)
    faded = rasterize(found, camera, 0 * sure)
    gray = UNKNOWN_COLOR * (1 - plain.image[..., 3:]) + plain.image[..., 3:] * np.float32(BACKGROUND)
    assert_allclose(faded.image[..., :3], gray, atol=1e-5)
    assert_array_equal(faded.colors, plain.colors)
