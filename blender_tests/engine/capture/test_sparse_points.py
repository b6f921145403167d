"""Reprojection errors of sparse points, and the camera files of splats."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import Capture, SparsePoints, View
from karf_engine.capture.distortion import distort
from karf_engine.capture.sparse_points import reprojection_errors, summarize
from karf_engine.capture.splat_cameras import cameras_beside, read_splat_cameras
from karf_engine.errors import DataError

PINHOLE = Camera(100, 80, 50.0, 50.0, 50.0, 40.0, np.eye(4))


def errors_of(number, cameras, positions, view, point, pixels):
    """Observed and projected pixels of one view of a capture with these points and observations."""
    views = tuple(View(f"v{i}", f"v{i}", camera, None, "train") for i, camera in enumerate(cameras))
    n = len(positions)
    colors, errors = np.zeros((n, 3), np.uint8), np.zeros(n, np.float32)
    observations = np.asarray(view, np.int32), np.asarray(point, np.int32), np.asarray(pixels, np.float32)
    points = SparsePoints(np.asarray(positions, np.float64), colors, errors, *observations)
    return reprojection_errors(Capture(Path(), "test", views, points=points), number)


def test_only_observations_of_the_view_are_compared():
    positions, pixels = [[0, 0, -1], [1, 0.5, -2]], [[75, 31.5], [9, 9], [53, 44]]
    observed, projected = errors_of(1, [PINHOLE, PINHOLE], positions, [1, 0, 1], [1, 0, 0], pixels)
    assert_allclose(observed, [[75, 31.5], [53, 44]])
    assert_allclose(projected, [[75, 27.5], [50, 40]])
    summary = summarize(observed, projected)
    assert (summary.count, summary.median, summary.worst) == (2, 4.5, 5.0)
    assert str(summary) == "2 points, median error 4.50 px, worst 5.00 px"


@pytest.mark.parametrize("fisheye", [False, True])
def test_points_are_projected_through_the_lens(fisheye):
    camera = Camera(400, 300, 300.0, 310.0, 196.0, 155.0, np.eye(4), (-0.2, 0.05, 0.003, -0.002), fisheye)
    positions = np.random.default_rng(0).uniform([-0.9, -0.6, -2], [0.9, 0.6, -1.5], (50, 3))
    shown = distort(camera, camera.project(positions)[0])
    summary = summarize(*errors_of(0, [camera], positions, np.zeros(50), np.arange(50), shown))
    assert summary.count == 50 and summary.worst < 1e-3
    assert np.abs(shown - camera.project(positions)[0]).max() > 1


def test_point_behind_the_camera_has_infinite_error():
    positions = [[0, 0, 1], [0, 0, -1], [0, 0, -3]]
    observed, projected = errors_of(0, [PINHOLE], positions, [0, 0, 0], [0, 1, 2], [[50, 40]] * 3)
    summary = summarize(observed, projected)
    assert np.isnan(projected[0]).all() and (summary.worst, summary.median) == (np.inf, 0)


def test_view_without_observations_has_no_error():
    summary = summarize(*errors_of(0, [PINHOLE], [[0, 0, -1]], [], [], np.empty((0, 2))))
    assert (summary.count, summary.median, summary.worst) == (0, 0, 0)


def test_capture_without_points_is_rejected(tmp_path):
    with pytest.raises(DataError, match="no sparse points"):
        reprojection_errors(Capture(tmp_path, "test", (View("v", "v", PINHOLE, None, "train"),)), 0)


def test_splat_camera_looks_along_its_third_column_with_y_down(tmp_path):
    entry = {
        "id": 0, "img_name": "IMG_1", "width": 640, "height": 480, "fx": 500.0, "fy": 510.0,
        "position": [1.0, 2.0, 3.0], "rotation": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    }  # fmt: skip
    (tmp_path / "cameras.json").write_text(json.dumps([entry]))
    (camera,) = read_splat_cameras(tmp_path / "cameras.json")
    assert (camera.width, camera.height, camera.fx, camera.fy) == (640, 480, 500, 510)
    # the camera's z is the world's y, its y the world's -z
    pixels, depth = camera.project(np.array([[1.0, 2 + 5, 3], [1, 2 + 5, 3 - 1]]))
    assert_allclose(pixels, [[320, 240], [320, 240 + 510 / 5]])
    assert_allclose(depth, 5)


@pytest.mark.parametrize("folder", [".", "point_cloud", "point_cloud/iteration_30000"])
def test_nearest_camera_files_of_a_splat_come_first(tmp_path, folder):
    above, near = tmp_path / "cameras.json", tmp_path / folder / "cameras.json"
    near.parent.mkdir(parents=True, exist_ok=True)
    above.write_text("[]")
    assert cameras_beside(near.with_name("point_cloud.ply")) == [above]
    assert cameras_beside(tmp_path.parent / "x.ply") == []
    near.write_text("[]")
    assert cameras_beside(near.with_name("point_cloud.ply")) == ([above] if near == above else [near, above])
