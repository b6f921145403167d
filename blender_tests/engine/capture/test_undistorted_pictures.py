"""Photos without their lens distortion, against OpenCV's documented models and its own maps."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

cv2 = pytest.importorskip("cv2")
pytest.importorskip("scipy")
pytest.importorskip("imageio.v3")
pytest.importorskip("OpenEXR")

from blender_tests.engine.reference.pictures import LENS, random_bytes, view_of
from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import View
from karf_engine.capture.training_images import lens_map, load_views, undistort
from karf_engine.io.images import resize, write_png


def distorted_pixel(camera, point):
    """OpenCV's documented model, written out for one point in camera axes (x right, y up, looking down -z)."""
    k1, k2, p1, p2, k3 = camera.distortion
    x, y = point[0] / -point[2], -point[1] / -point[2]
    r2 = x**2 + y**2
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    distorted_x = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
    distorted_y = y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y
    return camera.fx * distorted_x + camera.cx, camera.fy * distorted_y + camera.cy


def test_dots_photographed_through_the_lens_land_where_the_pinhole_says():
    camera = Camera(160, 120, 130.0, 120.0, 83.0, 57.0, np.eye(4), LENS)
    v, u = np.mgrid[0:120, 0:160] + 0.5
    points = [np.array([x, y, -2.0]) for x in np.linspace(-0.9, 0.9, 5) for y in np.linspace(-0.7, 0.7, 4)]
    photo = np.zeros((120, 160, 1))
    for point in points:
        dot_u, dot_v = distorted_pixel(camera, point)
        photo[..., 0] += np.exp(-((u - dot_u) ** 2 + (v - dot_v) ** 2) / (2 * 1.5**2))
    training_image, pinhole, valid = undistort(photo, camera)
    expected, _ = pinhole.project(np.array(points))
    moved = [np.hypot(*(np.array(distorted_pixel(camera, p)) - e)) for p, e in zip(points, expected, strict=True)]
    assert max(moved) > 3  # the lens really bends
    for target in expected:
        near = np.hypot(u - target[0], v - target[1]) < 6
        assert valid[near].all()
        weights = training_image[near, 0] / training_image[near, 0].sum()
        assert_allclose([weights @ u[near], weights @ v[near]], target, atol=0.05)


def test_undistortion_looks_up_the_photo_at_the_distorted_position():
    camera = Camera(160, 120, 130.0, 120.0, 83.0, 57.0, np.eye(4), LENS)
    v, u = np.mgrid[0:120, 0:160] + 0.5
    training_image, pinhole, valid = undistort(np.dstack([u, v, 0 * u]), camera)  # the photo shows its own coordinates
    assert (pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy) == (130.0, 120.0, 83.0, 57.0)
    assert (pinhole.width, pinhole.height, pinhole.distortion) == (160, 120, ())
    for row, column in ((0, 0), (60, 80), (33, 150), (119, 159), (100, 5)):
        local = [(column + 0.5 - 83.0) / 130.0, (57.0 - row - 0.5) / 120.0, -1.0]
        in_photo = distorted_pixel(camera, np.array(local))
        inside = 0 <= in_photo[0] <= 160 and 0 <= in_photo[1] <= 120
        assert valid[row, column] == inside
        if inside:
            assert_allclose(training_image[row, column, :2], np.clip(in_photo, 0.5, [159.5, 119.5]), atol=1e-4)


def test_pixels_beyond_the_fold_of_the_lens_model_are_invalid():
    camera = Camera(100, 100, 40.0, 40.0, 50.0, 50.0, np.eye(4), (-0.4, 0.0, 0.0, 0.0))
    _, _, valid = undistort(np.zeros((100, 100, 3)), camera)
    fold = 40.0 / np.sqrt(3 * 0.4)  # d/dr (r - 0.4 r^3) = 0
    radius = np.hypot(*(np.mgrid[0:100, 0:100] - 49.5))
    assert_array_equal(valid, radius < fold)


def test_a_lens_without_distortion_leaves_the_photo_alone():
    camera = Camera(4, 3, 5.0, 5.0, 2.0, 1.5, np.eye(4), (0.0, 0.0, 0.0, 0.0))
    photo = np.random.default_rng(3).random((3, 4, 3))
    training_image, pinhole, valid = undistort(photo, camera)
    assert_array_equal(training_image, photo)
    assert pinhole.distortion == () and valid.all()


LENSES = {
    "OPENCV": (LENS, False),
    "barrel": ((-0.25, 0.06, 0.0, 0.0), False),
    "rational": ((0.3, -0.1, 0.001, 0.002, 0.01, 0.5, -0.1, 0.02), False),
    "fisheye": ((-0.02, 0.01, -0.004, 0.001), True),
}


def opencv_map(camera):
    """OpenCV's own undistortion map; its pixel centers lie at integers."""
    matrix = np.array([[camera.fx, 0, camera.cx - 0.5], [0, camera.fy, camera.cy - 0.5], [0, 0, 1]])
    size, coefficients = (camera.width, camera.height), np.array(camera.distortion)
    make = cv2.fisheye.initUndistortRectifyMap if camera.fisheye else cv2.initUndistortRectifyMap
    return make(matrix, coefficients, np.eye(3), matrix, size, cv2.CV_32FC1)


@pytest.mark.parametrize("name", LENSES)
def test_every_lens_is_undistorted_as_opencv_does(name):
    camera = Camera(320, 240, 210.0, 205.0, 166.0, 115.0, np.eye(4), *LENSES[name])
    map_u, map_v = opencv_map(camera)
    assert (
        max(np.abs(map_u - np.arange(320)).max(), np.abs(map_v.T - np.arange(240)).max()) > 3
    )  # the lens really bends
    photo = cv2.GaussianBlur(np.random.default_rng(9).random((240, 320, 3), np.float32), (0, 0), 1.5)
    straight, _, valid = undistort(photo, camera)
    expected = cv2.remap(photo, map_u, map_v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=(9, 9, 9))
    inside = (np.minimum(map_u, map_v) >= 0) & (map_u <= 319) & (map_v <= 239)
    assert inside.mean() > 0.5
    assert_allclose(straight[inside], expected[inside], atol=1e-4)
    near = (np.minimum(map_u, map_v) >= -0.499) & (map_u <= 319.499) & (map_v <= 239.499)
    far = (np.minimum(map_u, map_v) < -0.501) | (map_u > 319.501) | (map_v > 239.501)
    assert valid[near].all() and not valid[far].any()


def test_a_lens_map_is_computed_once_for_views_that_share_it(tmp_path):
    lens_map.cache_clear()
    lens = [view_of(tmp_path / f"{i}.png", random_bytes(12, 18, 3), LENS) for i in range(5)]
    other = [view_of(tmp_path / f"b{i}.png", random_bytes(12, 18, 3), LENS[:4]) for i in range(5)]
    load_views([view for pair in zip(lens, other, strict=True) for view in pair], 9)
    assert lens_map.cache_info().misses == 2


def test_a_shrunken_photo_is_undistorted_without_loss_of_detail(tmp_path):
    camera = Camera(640, 480, 420.0, 410.0, 332.0, 230.0, np.eye(4), (0.12, 0.05, 0.011, -0.0095))
    smooth = cv2.GaussianBlur(np.random.default_rng(10).random((480, 640, 3)), (0, 0), 4)
    pixels = np.uint8(255 * (smooth - smooth.min()) / np.ptp(smooth))
    write_png(tmp_path / "a.png", pixels)
    (training_image,) = load_views([View("a", "a", camera, tmp_path / "a.png", "train")], 100)
    straight, _, valid = undistort(pixels / 255, camera)
    seen = resize(valid.astype(float), 100, 75) > 0.999
    difference = np.abs(training_image.color - resize(straight, 100, 75))[seen & training_image.valid]
    assert difference.max() < 0.03 and np.sqrt((difference**2).mean()) < 0.004
    assert (seen != training_image.valid).mean() < 0.02
