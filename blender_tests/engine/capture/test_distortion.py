"""Where lenses project points: the same as by OpenCV and COLMAP."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from karf_engine.capture.camera import Camera
from karf_engine.capture.colmap import FISHEYES, PINHOLES
from karf_engine.capture.colmap_model import PARAMETERS
from karf_engine.capture.distortion import BLOCK_ROWS, distort, undistort_points, undistorted
from karf_engine.capture.reader_utils import opencv_distortion

COEFFICIENTS = {"k1": 0.06, "k2": -0.02, "p1": 0.004, "p2": -0.003, "k3": 0.005, "k4": 0.03, "k5": -0.01, "k6": 0.002}
FOCAL_AND_CENTER = {"f": 510.0, "fx": 500.0, "fy": 520.0, "cx": 330.0, "cy": 235.0}
PLANE = np.stack(np.meshgrid(np.linspace(-0.7, 0.7, 15), np.linspace(-0.5, 0.5, 11)), -1).reshape(-1, 2)
LENSES = {
    **{f"perspective {n}": (tuple(COEFFICIENTS.values())[:n], False) for n in (4, 5, 8)},
    "fisheye": ((0.06, -0.02, 0.005, 0.03), True),
    "fisheye, no coefficients": ((), True),
}


def photo_positions(camera):
    """Where `distort` puts directions of the plane at depth one."""
    return distort(camera, (camera.cx, camera.cy) + PLANE * (camera.fx, camera.fy))


@pytest.mark.parametrize("name", LENSES)
def test_lenses_are_opencvs(name):
    cv2 = pytest.importorskip("cv2")
    distortion, fisheye = LENSES[name]
    camera = Camera(640, 480, 500.0, 520.0, 330.0, 235.0, np.eye(4), distortion, fisheye)
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    points, none = np.insert(PLANE, 2, 1.0, 1)[:, None], np.zeros(3)
    if fisheye:
        expected, _ = cv2.fisheye.projectPoints(points, none, none, matrix, np.array(distortion or np.zeros(4)))
    else:
        expected, _ = cv2.projectPoints(points, none, none, matrix, np.array(distortion))
    assert_allclose(photo_positions(camera), expected[:, 0], atol=1e-6)


@pytest.mark.parametrize("model", PINHOLES + FISHEYES)
def test_lenses_are_colmaps(model):
    pycolmap = pytest.importorskip("pycolmap")
    values = {name: {**COEFFICIENTS, **FOCAL_AND_CENTER}[name] for name in PARAMETERS[model].split()}
    theirs = pycolmap.Camera(model=model, width=640, height=480, params=list(values.values()))
    fx, fy = values.get("fx", values.get("f")), values.get("fy", values.get("f"))
    fisheye = model in FISHEYES
    camera = Camera(
        640, 480, fx, fy, values["cx"], values["cy"], np.eye(4), opencv_distortion(values, fisheye), fisheye
    )
    expected = theirs.img_from_cam(np.insert(PLANE, 2, 1.0, 1))
    assert_allclose(photo_positions(camera), expected, atol=1e-9)


@pytest.mark.parametrize("name", LENSES)
def test_straightening_takes_back_what_the_lens_does(name):
    distortion, fisheye = LENSES[name]
    camera = Camera(64, 48, 50.0, 52.0, 33.0, 23.5, np.eye(4), distortion, fisheye)
    found = undistort_points(camera, camera.pixel_centers())
    known = ~np.isnan(found).any(1)
    assert known.mean() > 0.9
    assert_allclose(distort(camera, found[known]), camera.pixel_centers()[known], atol=1e-4)


def test_what_a_lens_does_not_show_has_no_place_in_its_pinhole():
    camera = Camera(64, 48, 20.0, 20.0, 32.0, 24.0, np.eye(4), (-0.3, 0.0, 0.0, 0.0))  # folds over at r = 1.05
    found = undistort_points(camera, np.array([[32.0, 24.0], [33.0, 24.0], [1.0, 1.0]]))
    assert_allclose(found[:2], [[32, 24], [33, 24]], atol=0.05)
    assert np.isnan(found[2]).all()


@pytest.mark.parametrize("name", LENSES)
def test_undistorted_pixels_are_those_that_the_engine_learns_from(name):
    training_images = pytest.importorskip("karf_engine.capture.training_images")
    distortion, fisheye = LENSES[name]
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
