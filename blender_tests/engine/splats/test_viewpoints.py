"""Viewpoints chosen for imported Gaussians, points sampled on their surfaces, and confidence from photos."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

pytest.importorskip("numba")

from blender_tests.engine.splats.clouds import BACKGROUND, GROUPS, NEAR, ball, camera_ahead, cloud
from karf_engine.errors import Cancelled, DataError
from karf_engine.splats.gaussians import Gaussians, imported_gaussians
from karf_engine.splats.kernels.arrays import ANTIALIASED_FILTER, LOG_SCALE, LOGIT, PLAIN_FILTER, ROTATION
from karf_engine.splats.rasterizer import rasterize
from karf_engine.splats.view import UNKNOWN_COLOR
from karf_engine.splats.viewpoints import Target, cameras_around, estimate_target
from karf_engine.splats.visibility import AT_INFINITY, confidence_from, sample_surface_points, visibility_in_photos


def scene(*tables):
    return Gaussians(np.concatenate(tables), 0, (0, 0, 0), 1e-3)


def balls(centers, size, opacity=0.9):
    colors = np.random.default_rng(0).random((len(centers), 3))
    return np.stack([ball(center, size, opacity, color) for center, color in zip(centers, colors, strict=True)])


def disk(radius=1.0, height=0.0, count=1500, size=0.04):
    """A table top of flat Gaussians, perpendicular to z."""
    random = np.random.default_rng(1)
    turn, away = random.uniform(0, 2 * np.pi, count), radius * np.sqrt(random.random(count))
    table = balls(np.stack([away * np.cos(turn), away * np.sin(turn), np.full(count, height)], 1), size)
    table[:, LOG_SCALE + 2] = np.log(size / 10)
    return table


def heap(count=500):
    return balls(np.random.default_rng(2).normal(0, 0.15, (count, 3)) + (0, 0, 0.3), 0.03)


def sphere(radius, count=4000, size=1.0):
    directions = np.random.default_rng(3).normal(size=(count, 3))
    return balls(radius * directions / np.linalg.norm(directions, axis=1, keepdims=True), size)


def away_from(target, cameras):
    return np.array([np.linalg.norm(camera.position - target.middle) for camera in cameras])


def test_object_is_framed_from_all_sides():
    gaussians = scene(disk(), heap())
    target, within = estimate_target(gaussians), estimate_target(scene(disk(), heap(), sphere(60, 400)))
    assert np.linalg.norm(target.middle - within.middle) < 0.1, "a distant shell moves the target"
    assert within.distance == pytest.approx(target.distance, rel=0.2)
    cameras = cameras_around(gaussians, target, 12, 64)
    assert_allclose(target.up, (0, 0, 1), atol=0.1)
    assert np.linalg.norm(target.middle - (0, 0, 0.1)) < 0.2 and len(cameras) == 12
    sides = np.arctan2(*np.stack([camera.position - target.middle for camera in cameras])[:, :2].T)
    assert len(np.unique(np.round(sides / (np.pi / 2)))) >= 4
    for camera in cameras:
        pixels, depth = camera.project(gaussians.table[:, :3])
        assert (depth > 0).all() and ((pixels > 0) & (pixels < 64)).all(1).mean() > 0.9
        assert camera.position[2] > 0 and camera.camera_to_world[2, 1] > 0, "the camera is below, or upside down"
        assert (camera.width, camera.height) == (64, 64)


def test_gaussian_sizes_locate_the_cameras_of_a_room():
    """Each Gaussian's size grows with its distance from cameras two units around (1, 2, 0)."""
    random = np.random.default_rng(4)
    middle, places = np.array([1.0, 2, 0]), random.uniform(-8, 8, (6000, 3))
    sizes = 0.02 * np.sqrt(((places - middle) ** 2).sum(1) + 2.0**2) * np.exp(random.normal(0, 0.2, 6000))
    table = balls(places, 0.1)
    table[:, GROUPS["scales"]] = np.log(sizes)[:, None]
    target = estimate_target(scene(table))
    assert np.linalg.norm(target.middle - middle) < 0.3 and 1.8 < target.distance < 3.2


def test_no_camera_stands_inside_an_object():
    wall = balls(np.random.default_rng(5).uniform((1.2, -4, -1), (9, 4, 4), (6000, 3)), 0.15, 0.98)
    gaussians = scene(disk(count=4000, size=0.03), heap(2000), wall)
    target = Target(np.array([0, 0, 0.2]), np.array([0.0, 0, 1]), 3.0)
    for camera in cameras_around(gaussians, target, 8, 64):
        view = rasterize(gaussians, camera)
        nearest = view.blended((view.depths < 0.2 * away_from(target, [camera])[0]).astype(np.float32)[:, None])
        assert (nearest > 0.5).mean() < 0.1


def test_cameras_inside_the_target_look_outward():
    hollow = scene(*(sphere(radius, 2000, 0.3) for radius in np.arange(1.2, 7, 0.4)))
    target = Target(np.zeros(3), np.array([0.0, 0, 1]), 5.0)
    cameras = cameras_around(hollow, target, 9, 64)
    assert len(cameras) == 9 and away_from(target, cameras).max() < 1
    assert np.linalg.norm(sum(camera.camera_to_world[:3, 2] for camera in cameras)) < 2, (
        "the cameras do not look in all directions"
    )


def test_up_is_the_given_direction_or_colmaps():
    assert_allclose(estimate_target(scene(disk(), heap()), np.array([0.0, -2, 0])).up, (0, -1, 0))
    table = heap(3000)
    table[:, ROTATION:LOGIT] = np.random.default_rng(6).normal(size=(3000, 4))
    table[:, LOG_SCALE] -= 2
    assert_allclose(estimate_target(scene(table)).up, (0, -1, 0))


def test_haze_and_gaussians_in_one_place_are_rejected():
    with pytest.raises(DataError, match="almost all are transparent"):
        estimate_target(scene(balls(np.random.default_rng(7).normal(size=(50, 3)), 0.1, 0.05)))
    with pytest.raises(DataError, match="almost all lie in one place"):
        estimate_target(scene(balls(np.full((200, 3), 1.0), 0.1)))


def stop():
    raise Cancelled("stop", "")


def test_choosing_cameras_can_be_cancelled():
    gaussians = scene(disk(), heap())
    with pytest.raises(Cancelled):
        cameras_around(gaussians, estimate_target(gaussians), 8, 64, stop)


CAMERAS = [camera_ahead(80, 60, 80.0), camera_ahead(40, 30, 40.0)]
ABOVE = np.array([0.0, 0.0, 4.0])


def wall(z=0.0, reach=6.0, size=0.1):
    steps = np.arange(-reach, reach, size)
    table = np.stack([ball((x, y, z), size, 0.99, (0.8, 0.2, 0.1)) for x in steps for y in steps])
    table[:, LOG_SCALE + 2] = np.log(0.001)
    return table


def points_of(*tables, cameras=CAMERAS, check=lambda: None):
    return sample_surface_points(imported_gaussians(np.concatenate(tables), False, cameras), cameras, check)


@pytest.mark.parametrize(("is_antialiased", "expected"), [(False, PLAIN_FILTER), (True, ANTIALIASED_FILTER)])
def test_imported_gaussians_keep_their_screen_filter(is_antialiased, expected):
    gaussians = imported_gaussians(wall(), is_antialiased, CAMERAS)
    assert gaussians.screen_filter == expected and gaussians.background == (0, 0, 0) and gaussians.n_background == 0
    assert 0.01 < gaussians.near < 0.2


def test_sampled_points_lie_on_surfaces_and_name_their_cameras():
    points = points_of(wall())
    assert len(points) > 1000
    assert_allclose(points.positions[:, 2], 0, atol=0.02)
    assert_allclose(np.median(points.colors, 0), 255 * np.array([0.8, 0.2, 0.1]), atol=8)
    assert (np.bincount(points.point, minlength=len(points)) == 2).mean() > 0.95
    for number, camera in enumerate(CAMERAS):
        pixels, _ = camera.project(points.positions[points.point[points.view == number]])
        assert_allclose(points.pixels[points.view == number], pixels, atol=1e-3)


def test_hidden_points_are_not_observed():
    """A small wall near the first camera hides the far one from it; the second camera is behind the small one."""
    behind = camera_ahead(80, 60, 80.0)
    behind.camera_to_world[2, 3] = 1
    points = points_of(wall(), wall(2.0, 1.0), cameras=[CAMERAS[0], behind])
    pixels, _ = CAMERAS[0].project(points.positions)
    far = (points.positions[:, 2] < 1) & (np.abs(pixels - (40, 30)) < 20).all(1)
    assert far.sum() > 50 and not np.isin(points.point[points.view == 0], np.flatnonzero(far)).any()


def test_haze_and_sky_yield_no_points():
    haze = wall()
    haze[:, 10] = -4.0
    assert len(points_of(haze)) == 0
    points = points_of(wall(reach=1.2), wall(4 - 4 * 2 * AT_INFINITY, 60 * AT_INFINITY / 8, 2.0))
    assert len(points) and (points.positions[:, 2] > -1).all()


def test_sampling_points_can_be_cancelled():
    with pytest.raises(Cancelled):
        points_of(wall(), check=stop)


def camera_turned(degrees):
    """The camera ahead, turned about the x axis through the origin."""
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("x", degrees, degrees=True).as_matrix()
    camera = camera_ahead()
    return replace(camera, camera_to_world=pose @ camera.camera_to_world)


def photographed(rows, degrees):
    gaussians = Gaussians(np.stack(rows), 0, BACKGROUND, NEAR)
    return replace(gaussians, visibility=visibility_in_photos(gaussians, list(map(camera_turned, degrees))))


def test_confidence_falls_away_from_the_photo_directions():
    gaussians, degrees = photographed([ball()], (-20, 0, 20)), (0, 20, 29, 45, 61, 180)
    confidence = [float(confidence_from(gaussians, camera_turned(each).position)[0]) for each in degrees]
    assert confidence[:3] == [1, 1, 1] and 0 < confidence[3] < 1 and confidence[4:] == [0, 0]
    assert confidence_from(photographed([ball()], (0,)), ABOVE)[0] == 0.5, "a single photo gives half the confidence"


def test_gaussians_in_no_photo_have_no_confidence():
    hidden, beside = ball((0, 0, -1), size=0.02), ball((9, 0, 0))
    found = photographed([ball(opacity=0.999, size=0.5), ball((0, 0, 0.1), 0.5, 0.999), hidden, beside], (-3, 3))
    for eye in (ABOVE, -ABOVE):
        assert_array_equal(confidence_from(found, eye)[2:], [0, 0])
    assert_array_equal(confidence_from(found, ABOVE)[:2], [1, 1])


def test_unconfident_gaussians_turn_gray_and_confident_ones_stay_exact():
    found = Gaussians(cloud(), 0, BACKGROUND, NEAR)
    camera, sure = camera_ahead(), np.ones(len(found), np.float32)
    plain = rasterize(found, camera)
    assert_array_equal(rasterize(found, camera, sure).image, plain.image)
    faded = rasterize(found, camera, 0 * sure)
    gray = UNKNOWN_COLOR * (1 - plain.image[..., 3:]) + plain.image[..., 3:] * np.float32(BACKGROUND)
    assert_allclose(faded.image[..., :3], gray, atol=1e-5)
    assert_array_equal(faded.colors, plain.colors)
