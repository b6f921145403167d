"""Camera projection, lens distortion compared with OpenCV and COLMAP, and camera paths."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from blender_tests.engine.reference import still_life
from blender_tests.engine.reference.capture_files import random_rig
from karf_engine.capture.camera import Camera
from karf_engine.capture.camera_paths import camera_spline, orbit
from karf_engine.capture.colmap import FISHEYES, PINHOLES
from karf_engine.capture.colmap_model import PARAMETERS
from karf_engine.capture.distortion import BLOCK_ROWS, distort, undistort_points, undistort_points_near, undistorted
from karf_engine.capture.reader_utils import opencv_distortion
from karf_engine.errors import BadRequest

repeatable = settings(derandomize=True, max_examples=60, deadline=None)
COEFFICIENTS = {"k1": 0.06, "k2": -0.02, "p1": 0.004, "p2": -0.003, "k3": 0.005, "k4": 0.03, "k5": -0.01, "k6": 0.002}
PARAMETER_VALUES = COEFFICIENTS | {"f": 510.0, "fx": 500.0, "fy": 520.0, "cx": 330.0, "cy": 235.0}
PLANE = np.stack(np.meshgrid(np.linspace(-0.7, 0.7, 15), np.linspace(-0.5, 0.5, 11)), -1).reshape(-1, 2)
LENSES = {
    **{f"perspective {n}": (tuple(COEFFICIENTS.values())[:n], False) for n in (4, 5, 8)},
    "barrel": ((-0.25, 0.06, 0.0, 0.0), False),
    "bent": ((-0.12, 0.05, 0.011, -0.0095, 0.01), False),
    "rational": ((0.3, -0.1, 0.001, 0.002, 0.01, 0.5, -0.1, 0.02), False),
    "fisheye": ((0.06, -0.02, 0.005, 0.03), True),
    "fisheye, no coefficients": ((), True),
}


def test_point_to_the_upper_right_projects_to_the_upper_right():
    pixels, depth = Camera(100, 80, 50.0, 40.0, 50.0, 40.0, np.eye(4)).project(np.array([[1.0, 0.5, -2.0]]))
    assert_allclose(pixels, [[50 + 50 * 0.5, 40 - 40 * 0.25]])
    assert_allclose(depth, [2.0])


def test_pixel_centers_run_row_by_row():
    centers = Camera(3, 2, 1.0, 1.0, 1.5, 1.0, np.eye(4)).pixel_centers()
    assert_allclose(centers, [[0.5, 0.5], [1.5, 0.5], [2.5, 0.5], [0.5, 1.5], [1.5, 1.5], [2.5, 1.5]])


@repeatable
@given(st.integers(0, 10_000))
def test_points_along_rays_project_back_to_their_pixels(seed):
    (camera,) = random_rig(seed, 1)
    random = np.random.default_rng(seed + 1)
    pixels = random.uniform(0, [camera.width, camera.height], size=(50, 2))
    depth = random.uniform(0.1, 20.0, size=50)
    origins, directions = camera.rays(pixels)
    back, back_depth = camera.project(origins + depth[:, None] * directions)
    assert_allclose(back, pixels, atol=1e-7)
    assert_allclose(back_depth, depth, rtol=1e-9)


@repeatable
@given(st.integers(0, 10_000), st.integers(1, 500), st.integers(1, 500))
def test_scaled_camera_sees_a_point_at_the_scaled_pixel(seed, width, height):
    (camera,) = random_rig(seed, 1)
    origins, directions = camera.rays(np.array([[0.3 * camera.width, 0.9 * camera.height]]))
    pixels, _ = camera.scaled(width, height).project(origins + 3.0 * directions)
    assert_allclose(pixels, [[0.3 * width, 0.9 * height]], atol=1e-7)


@pytest.mark.parametrize("model", PINHOLES + FISHEYES)
def test_lens_models_match_colmap(model):
    pycolmap = pytest.importorskip("pycolmap")
    values = {name: PARAMETER_VALUES[name] for name in PARAMETERS[model].split()}
    theirs = pycolmap.Camera(model=model, width=640, height=480, params=list(values.values()))
    fx, fy = values.get("fx", values.get("f")), values.get("fy", values.get("f"))
    distortion = opencv_distortion(values, model in FISHEYES)
    camera = Camera(640, 480, fx, fy, values["cx"], values["cy"], np.eye(4), distortion, model in FISHEYES)
    expected = theirs.img_from_cam(np.insert(PLANE, 2, 1.0, 1))
    assert_allclose(distort(camera, (camera.cx, camera.cy) + PLANE * (fx, fy)), expected, atol=1e-9)


@pytest.mark.parametrize("name", LENSES)
def test_undistorting_points_inverts_the_lens(name):
    camera = Camera(64, 48, 50.0, 52.0, 33.0, 23.5, np.eye(4), *LENSES[name])
    found = undistort_points(camera, camera.pixel_centers())
    known = ~np.isnan(found).any(1)
    assert known.mean() > 0.9
    assert_allclose(distort(camera, found[known]), camera.pixel_centers()[known], atol=1e-4)


@pytest.mark.parametrize("fisheye", [False, True])
def test_nearby_photo_pixels_are_undistorted(fisheye):
    camera = Camera(400, 300, 300.0, 310.0, 196.0, 155.0, np.eye(4), (-0.2, 0.05, 0.003, -0.002), fisheye)
    random = np.random.default_rng(0)
    truth = random.uniform([20, 20], [380, 280], (200, 2))
    near = truth + random.normal(size=truth.shape) * 2
    assert np.abs(distort(camera, truth) - truth).max() > 3
    assert_allclose(undistort_points_near(camera, distort(camera, truth), near), truth, atol=1e-3)


def test_points_beyond_the_fold_have_no_undistorted_position():
    camera = Camera(64, 48, 20.0, 20.0, 32.0, 24.0, np.eye(4), (-0.3, 0.0, 0.0, 0.0))  # folds over at r = 1.05
    found = undistort_points(camera, np.array([[32.0, 24.0], [33.0, 24.0], [1.0, 1.0]]))
    assert_allclose(found[:2], [[32, 24], [33, 24]], atol=0.05)
    assert np.isnan(found[2]).all()


@pytest.fixture
def undistort():
    return pytest.importorskip("karf_engine.capture.training_images").undistort


@pytest.mark.parametrize("name", [name for name, (distortion, _) in LENSES.items() if distortion])
def test_undistorted_photos_match_opencv(name, undistort):
    cv2 = pytest.importorskip("cv2")
    camera = Camera(320, 240, 210.0, 205.0, 166.0, 115.0, np.eye(4), *LENSES[name])
    matrix = np.array([[210.0, 0, 165.5], [0, 205.0, 114.5], [0, 0, 1]])  # OpenCV's pixel centers are at integers
    make = cv2.fisheye.initUndistortRectifyMap if camera.fisheye else cv2.initUndistortRectifyMap
    map_u, map_v = make(matrix, np.array(camera.distortion), np.eye(3), matrix, (320, 240), cv2.CV_32FC1)
    assert max(np.abs(map_u - np.arange(320)).max(), np.abs(map_v.T - np.arange(240)).max()) > 3  # the lens bends
    photo = cv2.GaussianBlur(np.random.default_rng(9).random((240, 320, 3), np.float32), (0, 0), 1.5)
    straight, pinhole, valid = undistort(photo, camera)
    expected = cv2.remap(photo, map_u, map_v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=(9, 9, 9))
    inside = (np.minimum(map_u, map_v) >= 0) & (map_u <= 319) & (map_v <= 239)
    assert inside.mean() > 0.5
    assert_allclose(straight[inside], expected[inside], atol=1e-4)
    near = (np.minimum(map_u, map_v) >= -0.499) & (map_u <= 319.499) & (map_v <= 239.499)
    far = (np.minimum(map_u, map_v) < -0.501) | (map_u > 319.501) | (map_v > 239.501)
    assert valid[near].all() and not valid[far].any()
    assert (pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy) == (210.0, 205.0, 166.0, 115.0)
    assert (pinhole.width, pinhole.height, pinhole.distortion) == (320, 240, ())


def test_pixels_beyond_the_fold_of_the_lens_model_are_invalid(undistort):
    camera = Camera(100, 100, 40.0, 40.0, 50.0, 50.0, np.eye(4), (-0.4, 0.0, 0.0, 0.0))
    _, _, valid = undistort(np.zeros((100, 100, 3)), camera)
    fold = 40.0 / np.sqrt(3 * 0.4)  # d/dr (r - 0.4 r^3) = 0
    radius = np.hypot(*(np.mgrid[0:100, 0:100] - 49.5))
    assert_array_equal(valid, radius < fold)


def test_lens_without_distortion_leaves_the_photo_unchanged(undistort):
    photo, camera = np.random.default_rng(3).random((3, 4, 3)), Camera(4, 3, 5.0, 5.0, 2.0, 1.5, np.eye(4))
    straight, pinhole, valid = undistort(photo, replace(camera, distortion=(0.0, 0.0, 0.0, 0.0)))
    assert_array_equal(straight, photo)
    assert pinhole.distortion == () and valid.all()
    assert_array_equal(undistorted(photo, camera), photo)


@pytest.mark.parametrize("name", LENSES)
def test_numpy_undistortion_matches_the_engine(name, undistort):
    camera = Camera(120, BLOCK_ROWS + 40, 90.0, 95.0, 63.0, 80.0, np.eye(4), *LENSES[name])
    photo = np.random.default_rng(0).random((camera.height, camera.width, 3), np.float32)
    expected, _, valid = undistort(photo, camera)
    found = undistorted(photo, camera)
    assert valid.mean() > 0.5
    assert_allclose(found[valid], expected[valid], atol=1e-4)
    assert not found[~valid].any()


CENTER = np.array([1.0, -2.0, 0.5])


def camera_at(azimuth):
    """A camera that looks at CENTER from an elevation of 30 degrees and a distance of 4; z is up."""
    pose = still_life.camera_at(np.radians(azimuth), np.radians(30), distance=4.0).camera_to_world
    pose[:3, 3] += CENTER
    return Camera(64, 48, 80.0, 80.0, 30.0, 24.0, pose, distortion=(0.1, 0.0, 0.0, 0.0))


RING = [camera_at(azimuth) for azimuth in range(0, 360, 30)]


@pytest.mark.parametrize(("elevation", "expected"), [(None, 30.0), (0.0, 0.0), (60.0, 60.0)])
def test_orbit_keeps_the_center_radius_and_elevation_of_the_capture(elevation, expected):
    assert_allclose(orbit(RING[3:], 5)[0].position, RING[3].position, atol=1e-2)  # starts at the first camera
    path = orbit(RING, 8, elevation)
    offsets = np.stack([camera.position for camera in path]) - CENTER
    assert_allclose(np.linalg.norm(offsets, axis=1), 4.0, rtol=1e-3)
    assert_allclose(np.degrees(np.arcsin(offsets[:, 2] / 4.0)), expected, atol=0.1)
    steps = np.diff(np.unwrap(np.arctan2(offsets[:, 1], offsets[:, 0])))
    assert_allclose(np.abs(steps), np.pi / 4, atol=1e-3)
    for camera in path:
        pixels, depth = camera.project(CENTER[None])
        assert_allclose(pixels, [[32, 24]], atol=0.05)
        assert depth[0] > 0 and camera.is_pinhole


def test_spline_passes_through_its_cameras_with_valid_rotations():
    keys = [RING[0], replace(RING[2], fx=120.0, fy=120.0), RING[3]]
    path = camera_spline(keys, 9)
    for key, camera in zip(keys, path[::4], strict=True):
        assert_allclose(camera.camera_to_world, key.camera_to_world, atol=1e-9)
        assert camera.fx == pytest.approx(key.fx)
    for camera in path:
        rotation = camera.camera_to_world[:3, :3]
        assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
        assert (camera.width, camera.height) == (64, 48)


def test_closed_spline_does_not_repeat_its_first_camera():
    path = camera_spline(RING[:4], 8, is_closed=True)
    assert len(path) == 8
    for number in range(4):
        assert_allclose(path[2 * number].position, RING[number].position, atol=1e-9)


@pytest.mark.parametrize(
    "make", [lambda: orbit([], 3), lambda: orbit(RING, 0), lambda: orbit(RING, 3, 90.0),
             lambda: camera_spline(RING[:1], 5), lambda: camera_spline(RING, 1)],
)  # fmt: skip
def test_path_of_too_few_cameras_is_rejected(make):
    with pytest.raises(BadRequest):
        make()
