"""Where nothing can be: before cameras, and round them."""

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from blender_tests.engine.fields.test_extent import observed_by_all, views_of
from blender_tests.engine.reference.still_life import camera_at, cameras
from karf_engine.fields.free_space import CLEAR_SHARE, FREE_SHARE, FreeSpace, clear_radii, free_depths


def holds(views, places, points=None):
    return FreeSpace.from_views(views, points).contains(torch.tensor(np.array(places), dtype=torch.float32)).tolist()


def bounded(camera, nearest):
    return replace(views_of([camera])[0], depth_bounds=(nearest / FREE_SHARE, 99.0))


def test_what_a_camera_looks_through_is_free():
    camera = camera_at(0.0, 0.0)  # at x = 3.6, looks at the origin
    ahead, beside, behind, beyond = [2.0, 0, 0], [2.0, 1.5, 0], [4.5, 0, 0], [0.5, 0, 0]
    places = [ahead, beside, behind, beyond]
    assert holds([bounded(camera, 2.5)], places) == [True, False, False, False]
    assert not any(holds(views_of([camera]), places))
    opposite = camera_at(np.pi, 0.0)
    assert holds([bounded(camera, 0.5), bounded(opposite, 3.7)], places) == [False, False, False, False]
    assert holds([bounded(camera, 0.5), bounded(opposite, 4.2)], places) == [False, False, False, True]


def test_half_the_way_to_the_nearest_point_nothing_stands_round_a_camera_in_any_direction():
    views = views_of(cameras(6))
    points = observed_by_all(ball_of_points(), 6)
    position = views[0].camera.position
    assert clear_radii([views[0].camera], points) == [pytest.approx(CLEAR_SHARE * (3.6 - 1), abs=0.1)]
    back = position / np.linalg.norm(position)
    assert holds(views, [position + 1.1 * back, position + 1.6 * back], points) == [True, False]
    behind_it = observed_by_all(np.concatenate([ball_of_points(), position + back + 0.01 * ball_of_points(20)]), 6)
    assert holds(views, [position + 0.4 * back, position + 0.8 * back], behind_it) == [True, False]
    assert clear_radii([views[0].camera], observed_by_all(ball_of_points(40), 6)) == [0.0]


def ball_of_points(n=400, radius=1.0):
    directions = np.random.default_rng(0).normal(size=(n, 3))
    return radius * directions / np.linalg.norm(directions, axis=1, keepdims=True)


def test_a_view_is_free_up_to_its_own_nearest_depth():
    views = views_of(cameras(3))
    views[1] = replace(views[1], depth_bounds=(2.0, 9.0))
    views[2] = replace(views[2], depth_bounds=(3.0, 9.0))
    assert free_depths(views, None) == [0.0, FREE_SHARE * 2.0, FREE_SHARE * 3.0]
    depths = free_depths(views, observed_by_all(ball_of_points(), 3))
    of_points = pytest.approx(FREE_SHARE * 2.6, abs=0.1)
    assert depths == [of_points, FREE_SHARE * 2.0, of_points]
    assert free_depths(views, observed_by_all(ball_of_points(40), 3))[0] == 0.0


def test_what_is_near_but_has_its_features_in_other_views_is_not_free():
    views = views_of(cameras(6))
    near, far = ball_of_points(100, 0.5), ball_of_points(900, 8.0)
    points = observed_by_all(np.concatenate([near, far]), 6)
    without = points.point[(points.view != 0) | (points.point >= 100)]
    blind = replace(points, view=points.view[(points.view != 0) | (points.point >= 100)], point=without)
    assert free_depths(views, blind)[0] == free_depths(views, points)[0] < 3.2


def test_a_mistaken_point_does_not_tell_what_is_free():
    views = views_of(cameras(6))
    positions = np.concatenate([0.5 * views[0].camera.position[None], ball_of_points(300)])
    points = observed_by_all(positions, 6)
    depth = free_depths(views, points)[0]
    assert depth > FREE_SHARE * 2.4
    inexact = replace(points, errors=np.where(np.arange(301) < 250, 9.0, 0.2).astype(np.float32))
    assert free_depths(views, inexact)[0] > 0
    assert free_depths(views, points.seen_by([0, 1])) == [0.0] * 6
