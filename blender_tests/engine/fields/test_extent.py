"""Where a scene can be, as cameras, depth bounds and sparse points tell; and how finely photos look at it."""

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from blender_tests.engine.reference.still_life import camera_at, cameras
from karf_engine.capture.capture import SparsePoints, View
from karf_engine.fields.detail import kept_psnr, pixels_per_voxel, typical_pixels_per_voxel, without_detail
from karf_engine.fields.extent import FREE_SHARE, free_depths, is_free
from karf_engine.fields.spaces import contraction_round_focus
from karf_engine.rendering.space import Box, Contraction
from karf_engine.settings import OpenSettings


def views_of(cameras):
    return [View(f"view{n}", f"view{n}", camera, None, "train") for n, camera in enumerate(cameras)]


def observed_by_all(positions, n_views):
    n = len(positions)
    return SparsePoints(
        positions,
        np.zeros((n, 3), np.uint8),
        np.zeros(n, np.float32),
        np.repeat(np.arange(n_views), n).astype(np.int32),
        np.tile(np.arange(n), n_views).astype(np.int32),
        np.zeros((n * n_views, 2), np.float32),
    )


def zoomed(camera, factor):
    return replace(camera, fx=factor * camera.fx, fy=factor * camera.fy)


def test_what_a_camera_looks_through_is_free():
    camera = camera_at(0.0, 0.0)  # at x = 3.6, looks at the origin
    ahead, beside, behind = [2.0, 0, 0], [2.0, 1.5, 0], [4.5, 0, 0]
    beyond = [0.5, 0, 0]
    positions = np.array([ahead, beside, behind, beyond])
    assert is_free(positions, [camera], [2.5]).tolist() == [True, False, False, False]
    assert not is_free(positions, [camera], [0.0]).any()
    opposite = camera_at(np.pi, 0.0)
    assert is_free(positions, [camera, opposite], [0.5, 3.7]).tolist() == [False, False, False, False]
    assert is_free(positions, [camera, opposite], [0.5, 4.2]).tolist() == [False, False, False, True]


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


def test_the_contraction_keeps_as_much_as_the_lens_sees():
    wide, tele = (contraction_round_focus([zoomed(c, f) for c in cameras(12)], OpenSettings()) for f in (1, 4))
    assert wide.radius == pytest.approx(4 * tele.radius)
    camera = cameras(12)[0]
    middle = np.zeros((1, 3))
    of_wide = pixels_per_voxel(wide, 0.02, middle, camera)
    of_tele = pixels_per_voxel(tele, 0.02, middle, zoomed(camera, 4))
    np.testing.assert_allclose(of_wide, of_tele, rtol=1e-4)


def test_a_voxel_spans_as_many_pixels_as_it_projects_to():
    camera = camera_at(0.0, 0.3)
    place = np.array([[0.2, -0.1, 0.1]])
    _, depth = camera.project(place)
    np.testing.assert_allclose(pixels_per_voxel(Box(), 0.1, place, camera), 0.1 * camera.fx / depth, rtol=1e-3)
    ball = Contraction(torch.zeros(3), 0.5, 1.0, 0.1)
    np.testing.assert_allclose(pixels_per_voxel(ball, 0.1, place, camera), 0.05 * camera.fx / depth, rtol=1e-3)
    assert np.isnan(pixels_per_voxel(Box(), 0.1, 2 * camera.position[None], camera)).all()


def test_the_typical_voxel_lies_where_photos_look():
    views = views_of(cameras(6))
    near = observed_by_all(np.array([[0.0, 0.0, 0.5]]), 6)
    none = observed_by_all(np.zeros((0, 3)), 6)
    at_focus = typical_pixels_per_voxel(Box(), 0.1, views, None)
    assert at_focus == pytest.approx(0.1 * views[0].camera.fx / 3.6, rel=1e-3)
    assert typical_pixels_per_voxel(Box(), 0.1, views, none) == at_focus
    assert typical_pixels_per_voxel(Box(), 0.1, views, near) > 1.05 * at_focus


def test_a_photo_loses_the_detail_that_is_smaller_than_a_voxel():
    stripes = np.zeros((64, 64, 3))
    stripes[:, ::2] = 1
    np.testing.assert_allclose(without_detail(stripes, 2.0), 0.5)
    np.testing.assert_array_equal(without_detail(stripes, 1.0), stripes)
    smooth = np.tile(np.linspace(0, 1, 64)[:, None, None], (1, 64, 3))
    fine, coarse = kept_psnr([stripes, smooth], 4.0)
    assert fine == pytest.approx(6.02, abs=0.1) and coarse > 40
