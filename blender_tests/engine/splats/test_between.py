"""Between photos that stand far apart, all round, there are cameras which look at the same thing, and the field's pictures."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

torch = pytest.importorskip("torch")
pytest.importorskip("numba")

from karf_engine.capture.camera import Camera
from karf_engine.splats.start import PSEUDO_VIEWS_PER_PHOTO, SIDE, pseudo_cameras, render_pseudo_photos

MIDDLE = np.array([1.0, 2.0, 0.5])


def looking(direction, distance=4.0):
    """A camera that looks at MIDDLE from a direction, [3]."""
    back = np.asarray(direction) / np.linalg.norm(direction)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3] = np.stack([right, np.cross(back, right), back, MIDDLE + distance * back], 1)
    return Camera(80, 60, 90.0, 90.0, 40.0, 30.0, pose)


def ring(count):
    """Cameras all round, in two heights."""
    turns = 2 * np.pi * np.arange(count) / count
    return [looking((np.cos(turn), np.sin(turn), 0.4 + 0.4 * (number % 2)), 4) for number, turn in enumerate(turns)]


def scene(kind="opaque", shade=0.25):
    """What shows one gray everywhere, and notes from where it was looked at."""
    looks = []

    def render(camera, n_quantiles):
        looks.append(camera)
        return SimpleNamespace(color=torch.full((camera.height, camera.width, 3), shade))

    return SimpleNamespace(background_kind=kind, render=render, looks=looks)


def test_there_are_none_where_photos_stand_close_or_are_cut_out():
    assert len(pseudo_cameras(scene(), ring(10), 0)) == 10 * PSEUDO_VIEWS_PER_PHOTO
    assert pseudo_cameras(scene(), ring(60), 0) == []
    assert pseudo_cameras(scene("alpha"), ring(10), 0) == []
    assert pseudo_cameras(scene(), ring(2), 0) == []


def test_they_look_at_what_the_photos_look_at_each_from_its_photos_height_and_distance():
    cameras = ring(10)
    for number, camera in enumerate(pseudo_cameras(scene(), cameras, 0)):
        own, towards = cameras[number // PSEUDO_VIEWS_PER_PHOTO], MIDDLE - camera.position
        assert_allclose(np.linalg.norm(towards), 4, atol=1e-6)
        assert_allclose(-camera.camera_to_world[:3, 2], towards / 4, atol=1e-6)
        assert_allclose(camera.position[2], own.position[2], atol=1e-6)
        assert_allclose(camera.camera_to_world[2, :3], own.camera_to_world[2, :3], atol=1e-6)
        assert (camera.width, camera.fx) == (own.width, own.fx)


@pytest.mark.parametrize("photos", [ring(10), ring(10)[:6]], ids=["all round", "from one side"])
def test_they_stand_on_all_sides(photos):
    between = pseudo_cameras(scene(), photos, 0)
    beside = np.stack([camera.position - MIDDLE for camera in between])[:, :2]
    angles = np.sort(np.arctan2(*beside.T))
    gaps = np.diff(np.append(angles, angles[0] + 2 * np.pi))
    assert np.degrees(gaps.max()) < 360 / PSEUDO_VIEWS_PER_PHOTO + 1


def test_the_seed_says_where():
    first, again, other = (
        np.stack([each.position for each in pseudo_cameras(scene(), ring(10), seed)]) for seed in (0, 0, 1)
    )
    assert_allclose(first, again)
    assert np.abs(first - other).max() > 0.1


def test_their_pictures_are_the_fields_and_no_larger_than_it_is_fine():
    field, steps = scene(), []
    large = replace(ring(3)[0], width=2 * SIDE, height=SIDE, fx=600.0, fy=600.0, cx=256.0, cy=128.0)
    small, halved = render_pseudo_photos(field, [ring(3)[1], large], lambda: steps.append(1))
    assert small.color.shape == (60, 80, 3) and halved.color.shape == (SIDE // 2, SIDE, 3)
    assert (small.color == 64).all() and small.alpha is None and small.valid is None
    assert field.looks[1].fx == 300 and halved.camera.width == SIDE and len(steps) == 2
