"""cameras.json beside a splat: found, read as its authors' program writes it, refused where it is damaged."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from karf_engine.capture.splat_cameras import cameras_beside, read_splat_cameras

ENTRY = {
    "id": 0, "img_name": "IMG_1", "width": 640, "height": 480, "fx": 500.0, "fy": 510.0,
    "position": [1.0, 2.0, 3.0], "rotation": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
}  # fmt: skip


@pytest.fixture
def path(tmp_path):
    return tmp_path / "cameras.json"


def test_a_camera_looks_along_the_third_column_with_y_down(path):
    path.write_text(json.dumps([ENTRY]))
    (camera,) = read_splat_cameras(path)
    assert (camera.width, camera.height, camera.fx, camera.fy) == (640, 480, 500, 510)
    # z of the camera is the world's y, its y the world's -z
    pixels, depth = camera.project(np.array([[1.0, 2 + 5, 3], [1, 2 + 5, 3 - 1]]))
    assert_allclose(pixels, [[320, 240], [320, 240 + 510 / 5]])
    assert_allclose(depth, 5)


@pytest.mark.parametrize("folder", [".", "point_cloud", "point_cloud/iteration_30000"])
def test_it_is_found_beside_the_splat_or_above(tmp_path, path, folder):
    path.write_text("[]")
    (tmp_path / folder).mkdir(parents=True, exist_ok=True)
    assert cameras_beside(tmp_path / folder / "point_cloud.ply") == [path]
    assert cameras_beside(tmp_path.parent / "x.ply") == []


def test_the_nearest_is_the_first(tmp_path, path):
    near = tmp_path / "point_cloud" / "cameras.json"
    near.parent.mkdir()
    for place in (path, near):
        place.write_text("[]")
    assert cameras_beside(near.with_name("point_cloud.ply")) == [near, path]
