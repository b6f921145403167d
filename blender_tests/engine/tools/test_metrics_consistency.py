"""View consistency by geometry: a textured wall seen by two cameras, a thing that hides a part of it, and the figures."""

import numpy as np
import pytest

pytest.importorskip("scipy")
pytest.importorskip("cv2")

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


def camera_at(x):
    pose = np.eye(4)
    pose[0, 3] = x
    return Camera(SIZE, SIZE, FOCAL, FOCAL, SIZE / 2, SIZE / 2, pose)


def sight(x):
    return DepthView(camera_at(x), np.full((SIZE, SIZE), WALL), np.ones((SIZE, SIZE), bool))


def painted(x):
    """The wall's picture: colors that are linear in the place on the wall, so that bilinear samples are exact."""
    camera = camera_at(x)
    origins, directions = camera.rays(camera.pixel_centers())
    place = (origins + WALL * directions)[:, :2].reshape(SIZE, SIZE, 2)
    return np.concatenate([0.5 + place / 10, 0.5 - place[..., :1] / 10], -1)


def test_the_same_surface_looks_the_same_from_both_sides():
    pair = match_by_depth(sight(0.0), sight(0.73))
    assert len(pair.pixels) > 0.7 * SIZE**2
    assert pair.rmse(painted(0.0), painted(0.73)) == pytest.approx(0, abs=1e-9)


def test_a_color_that_follows_the_camera_is_an_error():
    pair = match_by_depth(sight(0.0), sight(0.73))
    assert pair.rmse(painted(0.0), painted(0.73) + 0.1) == pytest.approx(0.1)


def test_what_the_other_view_does_not_see_does_not_count():
    near = sight(0.73)
    near.depth[:, :20] = 2.0  # something stands before the left half of the wall
    pair = match_by_depth(sight(0.0), near)
    assert (pair.positions[:, 0] > 19).all() and len(pair.pixels) > 0.2 * SIZE**2


def test_only_points_inside_both_masks_count():
    view, other = sight(0.0), sight(0.73)
    view.mask[:10], other.mask[30:] = False, False
    pair = match_by_depth(view, other)
    rows = pair.pixels // SIZE
    assert rows.min() == 10 and rows.max() == 29


def test_the_mean_is_over_all_pairs_of_the_interval_that_say_something():
    assert mean_of_pairs(5, 2, lambda a, b: float(10 * a + b)) == np.mean([2, 13, 24])
    assert mean_of_pairs(3, 1, lambda a, b: float("nan") if a else 4.0) == 4.0
    assert np.isnan(mean_of_pairs(3, 3, lambda a, b: 1.0))


def flicker_of(pictures):
    """The flicker of three frames of the wall, taken from cameras in a row."""
    before, middle, after = (sight(x) for x in (-0.37, 0.0, 0.37))
    return flicker(match_by_depth(middle, before), match_by_depth(middle, after), pictures)


def test_what_stays_or_changes_steadily_does_not_flicker():
    first, middle, last = (painted(x) for x in (-0.37, 0.0, 0.37))
    assert flicker_of((first, middle, last)) == pytest.approx(0, abs=1e-9)
    assert flicker_of((first - 0.1, middle, last + 0.1)) == pytest.approx(0, abs=1e-9)


def test_a_frame_that_stands_out_flickers():
    first, middle, last = (painted(x) for x in (-0.37, 0.0, 0.37))
    assert flicker_of((first, middle + 0.1, last)) == pytest.approx(0.1 * np.sqrt(4 / 6))
    assert flicker_of((first, middle, last + 0.1)) == pytest.approx(0.1 * np.sqrt(1 / 6))


def test_noise_drawn_anew_in_each_frame_flickers_by_its_deviation():
    random = np.random.default_rng(0)
    noise = [np.broadcast_to(random.normal(0, 0.05, 3), (SIZE, SIZE, 3)) for _ in range(3000)]
    pairs = [match_by_depth(sight(0.0), sight(x)) for x in (-0.37, 0.37)]
    values = [flicker(*pairs, noise[n : n + 3]) for n in range(0, len(noise), 3)]
    assert np.sqrt(np.mean(np.square(values))) == pytest.approx(0.05, rel=0.05)


def test_only_points_that_all_three_frames_show_flicker():
    before, middle, after = (sight(x) for x in (-0.37, 0.0, 0.37))
    before.mask[:10], after.mask[30:] = False, False
    pairs, first, last = (match_by_depth(middle, before), match_by_depth(middle, after)), painted(-0.37), painted(0.37)
    shown = painted(0.0)
    shown[:10], shown[30:] = 1, 1
    assert flicker(*pairs, (first, shown, last)) == pytest.approx(0, abs=1e-9)
    before.mask[:] = False
    assert np.isnan(flicker(match_by_depth(middle, before), pairs[1], (first, shown, last)))


def test_flow_follows_a_picture_that_moves_and_carries_it_back():
    first, second = smooth_texture(0), smooth_texture(3)
    flow = optical_flow(first, second)
    assert np.abs(np.median(flow[10:-10, 10:-10], (0, 1)) - [3, 0]).max() < 0.2
    assert flow_rmse(first, second, first, second) < 0.02
    assert flow_rmse(first, second, first, second + 0.1) == pytest.approx(0.1, abs=0.02)


def test_nothing_is_hidden_in_a_pure_translation():
    forward = np.full((20, 30, 2), [4.0, -2.0], np.float32)
    assert visible_by_flow(forward, -forward).all()


def test_what_does_not_return_or_lies_at_a_motion_boundary_is_left_out():
    forward = np.full((20, 30, 2), [4.0, 0.0], np.float32)
    assert not visible_by_flow(forward, forward).any()
    forward[:, 15:] = 0
    visible = visible_by_flow(forward, -forward)
    assert not visible[:, 14:16].any() and visible[:, :9].all() and visible[:, 17:].all()


def test_samples_at_pixel_centers_are_the_pixels():
    picture = np.random.default_rng(0).random((5, 7, 3))
    centers = Camera(7, 5, 1, 1, 0, 0, np.eye(4)).pixel_centers()
    np.testing.assert_allclose(sample_bilinear(picture, centers), picture.reshape(-1, 3))
