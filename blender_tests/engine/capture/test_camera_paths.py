"""Camera paths stay around the scene, and pass through the cameras that they are given."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("scipy")

from karf_engine.capture.camera import Camera
from karf_engine.capture.camera_paths import camera_spline, orbit
from karf_engine.errors import BadRequest

CENTER = np.array([1.0, -2.0, 0.5])


def camera_at(azimuth, elevation=30.0, radius=4.0):
    """Return a camera that looks at CENTER; angles in degrees, z is up."""
    a, e = np.radians([azimuth, elevation])
    back = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    pose = np.eye(4)
    pose[:3] = np.stack([right, np.cross(back, right), back, CENTER + radius * back], 1)
    return Camera(64, 48, 80.0, 80.0, 30.0, 24.0, pose, distortion=(0.1, 0.0, 0.0, 0.0))


CAMERAS = [camera_at(azimuth) for azimuth in range(0, 360, 30)]


@pytest.mark.parametrize(("elevation", "expected"), [(None, 30.0), (0.0, 0.0), (60.0, 60.0)])
def test_an_orbit_looks_at_the_center_from_the_radius_and_elevation_of_the_capture(elevation, expected):
    path = orbit(CAMERAS, 8, elevation)
    offsets = np.stack([camera.position for camera in path]) - CENTER
    np.testing.assert_allclose(np.linalg.norm(offsets, axis=1), 4.0, rtol=1e-3)
    np.testing.assert_allclose(np.degrees(np.arcsin(offsets[:, 2] / 4.0)), expected, atol=0.1)
    steps = np.diff(np.unwrap(np.arctan2(offsets[:, 1], offsets[:, 0])))
    np.testing.assert_allclose(np.abs(steps), np.pi / 4, atol=1e-3)
    for camera in path:
        pixels, depth = camera.project(CENTER[None])
        np.testing.assert_allclose(pixels, [[32, 24]], atol=0.05)
        assert depth[0] > 0 and camera.is_pinhole


def test_an_orbit_begins_where_the_first_camera_is():
    np.testing.assert_allclose(orbit(CAMERAS[3:], 5)[0].position, CAMERAS[3].position, atol=1e-2)


def test_a_spline_passes_through_its_cameras_and_keeps_rotations():
    keys = [CAMERAS[0], replace(CAMERAS[2], fx=120.0, fy=120.0), CAMERAS[3]]
    path = camera_spline(keys, 9)
    for key, camera in zip(keys, path[::4], strict=True):
        np.testing.assert_allclose(camera.camera_to_world, key.camera_to_world, atol=1e-9)
        assert camera.fx == pytest.approx(key.fx)
    for camera in path:
        rotation = camera.camera_to_world[:3, :3]
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
        assert (camera.width, camera.height) == (64, 48)


def test_a_closed_spline_returns_to_its_first_camera_without_repeating_it():
    path = camera_spline(CAMERAS[:4], 8, is_closed=True)
    assert len(path) == 8
    np.testing.assert_allclose(path[0].position, CAMERAS[0].position, atol=1e-9)
    np.testing.assert_allclose(path[6].position, CAMERAS[3].position, atol=1e-9)


@pytest.mark.parametrize(
    "make", [lambda: orbit([], 3), lambda: orbit(CAMERAS, 0), lambda: orbit(CAMERAS, 3, 90.0),
             lambda: camera_spline(CAMERAS[:1], 5), lambda: camera_spline(CAMERAS, 1)],
)  # fmt: skip
def test_a_path_of_too_few_cameras_is_refused(make):
    with pytest.raises(BadRequest):
        make()
