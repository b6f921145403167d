"""What photos know of Gaussians: those that some show from about there; all else fades into gray."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

pytest.importorskip("torch")
pytest.importorskip("numba")

from blender_tests.engine.splats.clouds import BACKGROUND, NEAR, ball, camera_ahead, cloud
from karf_engine.splats.gaussians import Gaussians
from karf_engine.splats.rasterizer import UNKNOWN_COLOR, rasterize
from karf_engine.splats.visibility import confidence_from, visibility_in_photos

ABOVE = np.array([0.0, 0.0, 4.0])


def camera_turned(degrees):
    """The camera ahead, turned about the x axis through the origin."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.eye(4)
    turn[1:3, 1:3] = [[c, -s], [s, c]]
    camera = camera_ahead()
    return replace(camera, camera_to_world=turn @ camera.camera_to_world)


def gaussians(*rows):
    return Gaussians(np.stack(rows), 0, BACKGROUND, NEAR)


def looked_at(found, degrees):
    return replace(found, visibility=visibility_in_photos(found, [camera_turned(each) for each in degrees]))


def test_a_surface_is_known_from_where_photos_look_and_not_from_behind():
    found = looked_at(gaussians(ball()), (-20, 0, 20))
    from_degrees = [float(confidence_from(found, camera_turned(each).position)[0]) for each in (0, 20, 29, 45, 61, 180)]
    assert from_degrees[:3] == [1, 1, 1] and from_degrees[4:] == [0, 0]
    assert 0 < from_degrees[3] < 1


def test_what_no_photo_shows_is_unknown_from_everywhere():
    hidden, beside = ball((0, 0, -1), size=0.02), ball((9, 0, 0))
    found = looked_at(gaussians(ball(opacity=0.999, size=0.5), ball((0, 0, 0.1), 0.5, 0.999), hidden, beside), (-3, 3))
    for eye in (ABOVE, -ABOVE):
        assert_array_equal(confidence_from(found, eye)[2:], [0, 0])
    assert_array_equal(confidence_from(found, ABOVE)[:2], [1, 1])


def test_what_one_photo_shows_is_half_known():
    assert confidence_from(looked_at(gaussians(ball()), (0,)), ABOVE)[0] == 0.5


def test_the_unknown_is_gray_and_the_known_keeps_its_bits():
    found = Gaussians(cloud(), 0, BACKGROUND, NEAR)
    camera, sure = camera_ahead(), np.ones(len(found), np.float32)
    plain = rasterize(found, camera)
    assert_array_equal(rasterize(found, camera, sure).image, plain.image)
    faded = rasterize(found, camera, 0 * sure)
    gray = UNKNOWN_COLOR * (1 - plain.image[..., 3:]) + plain.image[..., 3:] * np.float32(BACKGROUND)
    np.testing.assert_allclose(faded.image[..., :3], gray, atol=1e-5)
    assert_array_equal(faded.colors, plain.colors)


def test_weights_are_what_gaussians_are_blended_with():
    view = rasterize(Gaussians(cloud(), 0, BACKGROUND, NEAR), camera_ahead())
    each = np.eye(60, dtype=np.float32)
    np.testing.assert_allclose(view.weights(), view.blended(each).sum((1, 2)), rtol=1e-4, atol=1e-4)
