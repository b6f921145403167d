"""Cameras for Gaussians without photos look at what photos looked at, from where nothing is in the way."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

pytest.importorskip("numba")

from blender_tests.engine.splats.clouds import GROUPS, ball
from karf_engine.errors import Cancelled, DataError
from karf_engine.splats.gaussians import Gaussians
from karf_engine.splats.kernels.arrays import LOG_SCALE, LOGIT, ROTATION
from karf_engine.splats.rasterizer import rasterize
from karf_engine.splats.viewpoints import Target, cameras_around, estimate_target


def scene(*tables):
    return Gaussians(np.concatenate(tables), 0, (0, 0, 0), 1e-3)


def balls(centers, size, opacity=0.9):
    colors = np.random.default_rng(0).random((len(centers), 3))
    return np.stack([ball(center, size, opacity, color) for center, color in zip(centers, colors, strict=True)])


def disk(radius=1.0, height=0.0, count=1500, size=0.04):
    """A table top across z: flat Gaussians."""
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


def test_an_object_is_framed_from_all_sides():
    gaussians = scene(disk(), heap())
    target = estimate_target(gaussians)
    cameras = cameras_around(gaussians, target, 12, 64)
    assert_allclose(target.up, (0, 0, 1), atol=0.1)
    assert np.linalg.norm(target.middle - (0, 0, 0.1)) < 0.2 and len(cameras) == 12
    sides = np.arctan2(*np.stack([camera.position - target.middle for camera in cameras])[:, :2].T)
    assert len(np.unique(np.round(sides / (np.pi / 2)))) >= 4
    for camera in cameras:
        pixels, depth = camera.project(gaussians.table[:, :3])
        assert (depth > 0).all() and ((pixels > 0) & (pixels < 64)).all(1).mean() > 0.9
        assert camera.position[2] > 0 and camera.camera_to_world[2, 1] > 0, "it hangs from below, or upside down"
        assert (camera.width, camera.height) == (64, 64)


def test_a_distant_shell_does_not_move_the_target():
    alone = estimate_target(scene(disk(), heap()))
    within = estimate_target(scene(disk(), heap(), sphere(60, 400)))
    assert np.linalg.norm(alone.middle - within.middle) < 0.1
    assert within.distance == pytest.approx(alone.distance, rel=0.2)


def test_sizes_of_gaussians_locate_the_cameras_of_a_room():
    """Of each Gaussian the size grows with the distance from cameras that stood two units around (1, 2, 0)."""
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
    assert np.linalg.norm(sum(camera.camera_to_world[:3, 2] for camera in cameras)) < 2, "they do not look all round"


def test_up_may_be_given_and_is_colmaps_where_no_floor_decides():
    given = estimate_target(scene(disk(), heap()), np.array([0.0, -2, 0]))
    assert_allclose(given.up, (0, -1, 0))
    table = heap(3000)
    table[:, ROTATION:LOGIT] = np.random.default_rng(6).normal(size=(3000, 4))
    table[:, LOG_SCALE] -= 2
    assert_allclose(estimate_target(scene(table)).up, (0, -1, 0))


@pytest.mark.parametrize(
    ("centers", "opacity", "words"),
    [
        (np.random.default_rng(7).normal(size=(50, 3)), 0.05, "almost all are transparent"),
        (np.full((200, 3), 1.0), 0.9, "almost all lie in one place"),
    ],
)
def test_a_file_of_haze_or_of_one_place_is_refused(centers, opacity, words):
    with pytest.raises(DataError, match=words):
        estimate_target(scene(balls(centers, 0.1, opacity)))


def test_choosing_can_be_cancelled():
    def stop():
        raise Cancelled("stop", "")

    gaussians = scene(disk(), heap())
    with pytest.raises(Cancelled):
        cameras_around(gaussians, estimate_target(gaussians), 8, 64, stop)
