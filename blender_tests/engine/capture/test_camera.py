"""The pinhole camera: conventions by hand, round trips by random rigs."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from karf_engine.capture.camera import Camera

repeatable = settings(derandomize=True, max_examples=60, deadline=None)


def random_camera(seed: int) -> Camera:
    random = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(random.normal(size=(3, 3)))
    pose = np.eye(4)
    pose[:3, :3] = rotation * np.sign(np.linalg.det(rotation))
    pose[:3, 3] = random.normal(size=3) * 5
    width, height = (int(n) for n in random.integers(8, 900, size=2))
    fx, fy = random.uniform(0.5, 2.0, size=2) * width
    return Camera(width, height, fx, fy, width * 0.47, height * 0.55, pose)


def test_a_point_to_the_upper_right_lands_in_the_upper_right_by_hand():
    camera = Camera(100, 80, 50.0, 40.0, 50.0, 40.0, np.eye(4))
    pixels, depth = camera.project(np.array([[1.0, 0.5, -2.0]]))
    assert_allclose(pixels, [[50 + 50 * 0.5, 40 - 40 * 0.25]])
    assert_allclose(depth, [2.0])


def test_the_central_ray_looks_down_minus_z():
    camera = Camera(100, 80, 50.0, 40.0, 50.0, 40.0, np.eye(4))
    origins, directions = camera.rays(np.array([[50.0, 40.0]]))
    assert_allclose(origins, [[0, 0, 0]])
    assert_allclose(directions, [[0, 0, -1]])


@repeatable
@given(st.integers(0, 10_000))
def test_points_along_rays_project_back_to_their_pixels_and_depths(seed):
    camera = random_camera(seed)
    random = np.random.default_rng(seed + 1)
    pixels = random.uniform(0, [camera.width, camera.height], size=(50, 2))
    depth = random.uniform(0.1, 20.0, size=50)
    origins, directions = camera.rays(pixels)
    back, back_depth = camera.project(origins + depth[:, None] * directions)
    assert_allclose(back, pixels, atol=1e-7)
    assert_allclose(back_depth, depth, rtol=1e-9)


@repeatable
@given(st.integers(0, 10_000), st.integers(1, 500), st.integers(1, 500))
def test_scaled_cameras_see_the_same_point_at_the_scaled_pixel(seed, width, height):
    camera = random_camera(seed)
    scaled = camera.scaled(width, height)
    origins, directions = camera.rays(np.array([[0.3 * camera.width, 0.9 * camera.height]]))
    pixels, _ = scaled.project(origins + 3.0 * directions)
    assert_allclose(pixels, [[0.3 * width, 0.9 * height]], atol=1e-8)


def test_pixel_centers_run_row_by_row():
    centers = Camera(3, 2, 1.0, 1.0, 1.5, 1.0, np.eye(4)).pixel_centers()
    assert_allclose(centers, [[0.5, 0.5], [1.5, 0.5], [2.5, 0.5], [0.5, 1.5], [1.5, 1.5], [2.5, 1.5]])
