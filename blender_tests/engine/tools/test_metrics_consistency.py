"""View consistency scores on a painted wall seen by several cameras."""

import numpy as np
import pytest

from blender_tests.engine.reference.textures import smooth_texture
from karf_engine.capture.camera import Camera
from tools.metrics.consistency import (
    DepthView,
    flicker,
    flow_rmse,
    match_by_depth,
    mean_of_pairs,
    optical_flow,
    sample_bilinear,
    visible_by_flow,
)

SIZE, FOCAL, WALL = 40, 40.0, 4.0  # the wall is the plane z = -4 before cameras that look down -z
STEPS = (-0.37, 0.0, 0.37)  # x of three cameras in a row


def camera_at(x):
    pose = np.eye(4)
    pose[0, 3] = x
    return Camera(SIZE, SIZE, FOCAL, FOCAL, SIZE / 2, SIZE / 2, pose)


def wall_view(x):
    return DepthView(camera_at(x), np.full((SIZE, SIZE), WALL), np.ones((SIZE, SIZE), bool))


def painted(x):
    """The wall's picture: colors linear in the position on the wall, which bilinear samples keep exactly."""
    camera = camera_at(x)
    origins, directions = camera.rays(camera.pixel_centers())
    place = (origins + WALL * directions)[:, :2].reshape(SIZE, SIZE, 2)
    return np.concatenate([0.5 + place / 10, 0.5 - place[..., :1] / 10], -1)


@pytest.mark.parametrize("added", [0, 0.1])
def test_rmse_is_the_color_difference_of_matched_points(added):
    pair = match_by_depth(wall_view(0.0), wall_view(0.73))
    assert len(pair.pixels) > 0.7 * SIZE**2
    assert pair.rmse(painted(0.0), painted(0.73) + added) == pytest.approx(added, abs=1e-9)


def test_matches_are_visible_and_inside_both_masks():
    view, other = wall_view(0.0), wall_view(0.73)
    view.mask[:10], other.mask[30:] = False, False
    other.depth[:, :20] = 2.0  # something hides the left half of the wall
    pair = match_by_depth(view, other)
    rows = pair.pixels // SIZE
    assert rows.min() == 10 and rows.max() == 29
    assert (pair.positions[:, 0] > 19).all() and len(pair.pixels) > 0.1 * SIZE**2


def test_mean_of_pairs_skips_nan():
    assert mean_of_pairs(5, 2, lambda a, b: float(10 * a + b)) == np.mean([2, 13, 24])
    assert mean_of_pairs(3, 1, lambda a, b: float("nan") if a else 4.0) == 4.0
    assert np.isnan(mean_of_pairs(3, 3, lambda a, b: 1.0))


def flicker_of(pictures, views=None):
    before, middle, after = views or map(wall_view, STEPS)
    return flicker(match_by_depth(middle, before), match_by_depth(middle, after), pictures)


@pytest.mark.parametrize(
    ("added", "expected"),
    [
        ((0, 0, 0), 0),
        ((-0.1, 0, 0.1), 0),  # steady change
        ((0, 0.1, 0), 0.1 * np.sqrt(4 / 6)),
        ((0, 0, 0.1), 0.1 * np.sqrt(1 / 6)),
    ],
)
def test_flicker_measures_deviating_frames(added, expected):
    pictures = [painted(x) + more for x, more in zip(STEPS, added, strict=True)]
    assert flicker_of(pictures) == pytest.approx(expected, abs=1e-9)


def test_flicker_of_noise_is_its_standard_deviation():
    before, middle, after = map(wall_view, STEPS)
    pairs = match_by_depth(middle, before), match_by_depth(middle, after)
    colors = np.random.default_rng(0).normal(0, 0.05, (1000, 3, 1, 1, 3))
    values = [flicker(*pairs, np.broadcast_to(each, (3, SIZE, SIZE, 3))) for each in colors]
    assert np.sqrt(np.mean(np.square(values))) == pytest.approx(0.05, rel=0.05)


def test_flicker_uses_points_visible_in_all_frames():
    three = [wall_view(x) for x in STEPS]
    three[0].mask[:10], three[2].mask[30:] = False, False
    first, shown, last = (painted(x) for x in STEPS)
    shown[:10], shown[30:] = 1, 1
    assert flicker_of((first, shown, last), three) == pytest.approx(0, abs=1e-9)
    three[0].mask[:] = False
    assert np.isnan(flicker_of((first, shown, last), three))


def test_optical_flow_follows_a_moving_picture():
    first, second = smooth_texture(0), smooth_texture(3)
    flow = optical_flow(first, second)
    assert np.abs(np.median(flow[10:-10, 10:-10], (0, 1)) - [3, 0]).max() < 0.2
    assert flow_rmse(first, second, first, second) < 0.02
    assert flow_rmse(first, second, first, second + 0.1) == pytest.approx(0.1, abs=0.02)


def test_inconsistent_flow_and_motion_boundaries_are_excluded():
    forward = np.full((20, 30, 2), [4.0, -2.0], np.float32)
    assert visible_by_flow(forward, -forward).all() and not visible_by_flow(forward, forward).any()
    forward[:, 15:] = 0
    visible = visible_by_flow(forward, -forward)
    assert not visible[:, 14:16].any() and visible[:, :9].all() and visible[:, 17:].all()


def test_samples_at_pixel_centers_are_pixels():
    picture = np.random.default_rng(0).random((5, 7, 3))
    centers = Camera(7, 5, 1, 1, 0, 0, np.eye(4)).pixel_centers()
    np.testing.assert_allclose(sample_bilinear(picture, centers), picture.reshape(-1, 3))
