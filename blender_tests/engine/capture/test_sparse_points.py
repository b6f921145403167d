"""Observed against projected points: by hand, through lenses, and where a capture has none."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from karf_engine.capture import open_capture
from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import Capture, SparsePoints, View
from karf_engine.capture.distortion import distort, undistort_points_near
from karf_engine.capture.sparse_points import reprojection_errors, summarize
from karf_engine.errors import DataError

BARREL = (-0.2, 0.05, 0.003, -0.002)


def capture_of(tmp_path, cameras, positions, view, point, pixels):
    views = tuple(View(f"v{i}", f"v{i}", camera, None, "train") for i, camera in enumerate(cameras))
    n = len(positions)
    points = SparsePoints(
        np.asarray(positions, np.float64),
        np.zeros((n, 3), np.uint8),
        np.zeros(n, np.float32),
        np.asarray(view, np.int32),
        np.asarray(point, np.int32),
        np.asarray(pixels, np.float32),
    )
    return Capture(tmp_path, "test", views, points=points)


def test_only_the_views_own_observations_are_compared(tmp_path):
    camera = Camera(100, 80, 50.0, 50.0, 50.0, 40.0, np.eye(4))
    positions = [[0, 0, -1], [1, 0.5, -2]]
    capture = capture_of(tmp_path, [camera, camera], positions, [1, 0, 1], [1, 0, 0], [[75, 31.5], [9, 9], [53, 44]])
    observed, projected = reprojection_errors(capture, 1)
    assert_allclose(observed, [[75, 31.5], [53, 44]])
    assert_allclose(projected, [[75, 27.5], [50, 40]])
    summary = summarize(observed, projected)
    assert (summary.count, summary.median, summary.worst) == (2, 4.5, 5.0)
    assert str(summary) == "2 points, median error 4.50 px, worst 5.00 px"


@pytest.mark.parametrize("fisheye", [False, True])
def test_points_pass_through_the_lens_of_the_photo_as_stored(tmp_path, fisheye):
    camera = Camera(400, 300, 300.0, 310.0, 196.0, 155.0, np.eye(4), BARREL, fisheye)
    positions = np.random.default_rng(0).uniform([-0.9, -0.6, -2], [0.9, 0.6, -1.5], (50, 3))
    shown = distort(camera, camera.project(positions)[0])
    capture = capture_of(tmp_path, [camera], positions, np.zeros(50), np.arange(50), shown)
    summary = summarize(*reprojection_errors(capture, 0))
    assert summary.count == 50 and summary.worst < 1e-3
    assert np.abs(shown - camera.project(positions)[0]).max() > 1


def test_a_point_behind_the_camera_counts_as_infinitely_far(tmp_path):
    camera = Camera(100, 80, 50.0, 50.0, 50.0, 40.0, np.eye(4))
    capture = capture_of(tmp_path, [camera], [[0, 0, 1], [0, 0, -1], [0, 0, -3]], [0, 0, 0], [0, 1, 2], [[50, 40]] * 3)
    observed, projected = reprojection_errors(capture, 0)
    assert np.isnan(projected[0]).all()
    assert summarize(observed, projected).worst == np.inf
    assert summarize(observed, projected).median == 0


def test_a_view_that_observed_nothing_has_nothing_wrong(tmp_path):
    camera = Camera(100, 80, 50.0, 50.0, 50.0, 40.0, np.eye(4))
    summary = summarize(*reprojection_errors(capture_of(tmp_path, [camera], [[0, 0, -1]], [], [], np.empty((0, 2))), 0))
    assert (summary.count, summary.median, summary.worst) == (0, 0, 0)


def test_a_capture_without_points_is_refused(tmp_path):
    camera = Camera(100, 80, 50.0, 50.0, 50.0, 40.0, np.eye(4))
    with pytest.raises(DataError, match="no sparse points"):
        reprojection_errors(Capture(tmp_path, "test", (View("v", "v", camera, None, "train"),)), 0)


@pytest.mark.parametrize("fisheye", [False, True])
def test_photo_pixels_near_a_point_are_found_in_the_pinholes_picture(fisheye):
    camera = Camera(400, 300, 300.0, 310.0, 196.0, 155.0, np.eye(4), BARREL, fisheye)
    random = np.random.default_rng(0)
    truth = random.uniform([20, 20], [380, 280], (200, 2))
    near = truth + random.normal(size=truth.shape) * 2
    found = undistort_points_near(camera, distort(camera, truth), near)
    assert np.abs(found - truth).max() < 1e-3
    assert np.abs(distort(camera, truth) - truth).max() > 3


def test_a_real_models_points_lie_where_its_photos_show_them(scenes):
    capture = open_capture(scenes / "bonsai")
    for number in range(0, len(capture.views), 20):
        summary = summarize(*reprojection_errors(capture, number))
        assert summary.count > 100 and summary.median < 0.7 and summary.worst < 10
