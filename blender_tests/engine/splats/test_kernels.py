"""Pictures of Gaussians and their gradients by the kernels are those of the formulas; the cores make no difference."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

torch = pytest.importorskip("torch")
pytest.importorskip("numba")

from blender_tests.engine.splats.clouds import BACKGROUND, GROUPS, NEAR, ball, camera_ahead, cloud
from blender_tests.engine.splats.torch_splats import splat
from karf_engine.compute import cores
from karf_engine.errors import OutOfMemory
from karf_engine.splats.kernels.arrays import (
    ANTIALIASED_FILTER,
    BORDER,
    LOGIT,
    PIXEL_FILTER,
    PLAIN_FILTER,
    ROTATION,
)
from karf_engine.splats.rasterizer import RasterizedView, pinhole

CAMERA = pinhole(camera_ahead(), NEAR)
QUARTERS = (0, 0.25, 0.5, 0.75)


def shown(*rows, camera=CAMERA, background=BACKGROUND):
    return RasterizedView(np.stack(rows), camera, background)


def both_gradients(table, weights, camera=CAMERA):
    """The gradients of a weighted sum of the picture's colors, by the kernels and by torch."""
    by_kernels = np.zeros_like(table)
    RasterizedView(table, camera, BACKGROUND).backward(weights, by_kernels)
    variable = torch.from_numpy(table).double().requires_grad_()
    (splat(variable, camera, BACKGROUND)[..., :3] * torch.from_numpy(weights)).sum().backward()
    return by_kernels, variable.grad.numpy()


@pytest.fixture
def two_cores():
    before = cores.core_count()
    yield
    cores.set_core_count(before)


def test_gaussians_that_all_cover_a_large_picture_are_refused_before_they_are_dealt_out():
    """Their tiles would be more than 32 bits count, and entries be written beside their array."""
    camera = camera_ahead().scaled(4096, 4096)
    wide = np.repeat(ball((0, 0, 0), 50.0, 0.9, (1, 1, 1))[None], 40_000, 0)
    with pytest.raises(OutOfMemory, match="40000 Gaussians cover too much of a picture of 4096x4096 pixels"):
        RasterizedView(wide, pinhole(camera, NEAR), BACKGROUND)


# ------------------------------------------------------------------------------------------------------- the formulas
@pytest.mark.parametrize("degree", range(4))
@pytest.mark.parametrize(
    "screen_filter", [PIXEL_FILTER, PLAIN_FILTER, ANTIALIASED_FILTER], ids=["own", "plain", "anti"]
)
def test_a_picture_and_its_gradients_are_those_of_the_formulas(degree, screen_filter):
    table, camera = cloud(degree=degree), pinhole(camera_ahead(), NEAR, screen_filter)
    truth = splat(torch.from_numpy(table).double(), camera, BACKGROUND).numpy()
    assert_allclose(shown(*table, camera=camera).image, truth, atol=1e-5)
    weights = np.random.default_rng(1).normal(size=(*truth.shape[:2], 3)).astype(np.float32)
    by_kernels, by_torch = both_gradients(table, weights, camera)
    for name, columns in GROUPS.items():
        own = by_torch[:, columns]
        assert own.size == 0 or abs(own).max() > 0.1, f"nothing depends on the {name}"
        assert_allclose(by_kernels[:, columns], own, atol=3e-5 * abs(by_torch).max(), err_msg=name)


def test_gradients_are_the_differences_of_pictures():
    table = np.stack([ball((0.02, 0.01, 0.3), 0.5, 0.5, degree=1), ball((-0.1, 0.1, -0.3), 0.8, 0.6, degree=1)])
    random = np.random.default_rng(2)
    table[:, ROTATION:LOGIT] += random.normal(0, 0.2, (2, 4))
    table[:, GROUPS["scales"]] += random.normal(0, 0.2, (2, 3))
    camera = pinhole(camera_ahead(16, 16, 40), NEAR)  # in a picture this small no Gaussian has an end
    weights = random.normal(size=(16, 16, 3)).astype(np.float32)
    gradients = np.zeros_like(table)
    shown(*table, camera=camera).backward(weights, gradients)
    for place in np.ndindex(table.shape):
        sums = []
        for step in (1e-2, -1e-2):
            moved = table.copy()
            moved[place] += step
            sums.append(float((shown(*moved, camera=camera).image[..., :3].astype(float) * weights).sum()))
        difference = (sums[0] - sums[1]) / 2e-2
        assert difference == pytest.approx(float(gradients[place]), abs=2e-3 * float(abs(gradients).max())), place


def test_gradients_of_many_gaussians_one_behind_another_stay_those_of_the_formulas():
    table = cloud(30, 0, seed=3)
    table[:, LOGIT] = 3.0
    weights = np.random.default_rng(3).normal(size=(36, 40, 3)).astype(np.float32)
    by_kernels, by_torch = both_gradients(table, weights)
    assert_allclose(by_kernels, by_torch, atol=1e-4 * abs(by_torch).max())


def test_what_is_not_seen_has_no_gradient():
    table = np.stack([ball(), ball((0, 0, 9))])
    gradients = np.full_like(table, 7)
    shown(*table).backward(np.ones((36, 40, 3), np.float32), gradients)
    assert (gradients[1] == 7).all() and not (gradients[0] == 7).any()


# ---------------------------------------------------------------------------------------------------------- what is seen
@pytest.mark.parametrize("place", [(0, 0, 4.5), (0, 0, 3.9), (30, 0, 0), (0, -30, 0)], ids=str)
def test_what_is_behind_the_camera_too_near_or_outside_is_not_seen(place):
    view = shown(ball(place, 0.02))
    assert view.offsets[-1] == 0
    assert_array_equal(view.image, np.broadcast_to(np.float32([*BACKGROUND, 1]), (36, 40, 4)))


def test_a_large_gaussian_that_lies_somewhat_outside_still_reaches_in():
    beside = 4 * (20 + 0.9 * BORDER * 40) / 50
    assert shown(ball((beside, 0, 0), 0.6)).image[..., 3].min() < 0.9


def test_the_nearer_one_hides_the_other_whatever_their_order():
    red, blue = ball((0, 0, 1), 0.3, 0.98, (1, 0, 0)), ball((0, 0, -1), 0.3, 0.98, (0, 0, 1))
    first, second = shown(red, blue).image, shown(blue, red).image
    assert_array_equal(first, second)
    assert first[18, 20, 0] > 0.9 > 0.1 > first[18, 20, 2]


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf, 1e30, -1e30, 200])
def test_numbers_from_which_no_ellipse_follows_show_nothing_and_break_nothing(wrong):
    plain = ball((0.3, 0.1, 0), 0.1)
    alone = shown(plain).image
    for column in range(LOGIT):
        strange = ball()
        strange[column] = wrong
        image = shown(plain, strange).image
        assert image.shape == alone.shape and np.isfinite(image).all(), column
    turned_by_nothing = ball()
    turned_by_nothing[ROTATION:LOGIT] = 0
    assert_array_equal(shown(plain, turned_by_nothing).image, alone)


def test_nothing_at_all_is_the_background():
    image = RasterizedView(cloud(0), CAMERA, BACKGROUND).image
    assert_array_equal(image, np.broadcast_to(np.float32([*BACKGROUND, 1]), image.shape))


# ------------------------------------------------------------------------------------------------------- other values
def test_blended_ones_are_what_no_light_comes_through():
    view = shown(*cloud())
    ones = view.blended(np.ones((60, 1), np.float32))[0]
    assert_allclose(ones, 1 - view.image[..., 3], atol=1e-6)


def test_blended_colors_are_the_picture_before_its_background():
    view = shown(*cloud())
    colors = view.blended(view.colors)
    assert_allclose(
        np.moveaxis(colors, 0, -1) + view.image[..., 3:] * np.float32(BACKGROUND), view.image[..., :3], atol=1e-5
    )


# ---------------------------------------------------------------------------------------------------- pictures of any size
def means_of(image, count):
    height, width = image.shape[0] // count, image.shape[1] // count
    return image.reshape(height, count, width, count, -1).mean((1, 3))


def size_of(scale, size):
    return RasterizedView(
        np.stack([ball(size=size)]), pinhole(camera_ahead().scaled(40 * scale, 36 * scale), NEAR), (0, 0, 0)
    )


@pytest.mark.parametrize("size", [0.03, 0.1, 0.3])
def test_a_picture_of_twice_the_size_averages_to_the_same(size):
    """Without a filter of the pixel's own size small Gaussians would vanish or thicken."""
    plain, fine = size_of(1, size).image, means_of(size_of(2, size).image, 2)
    assert_allclose(fine, plain, atol=0.09)
    covered = [(1 - image[..., 3]).sum() for image in (plain, fine)]
    assert covered[1] == pytest.approx(covered[0], rel=0.12)


def covered_by(row, camera):
    """How many pixels a Gaussian covers, on average over its places within a pixel."""
    moved = [
        camera._replace(cx=camera.cx + np.float32(x), cy=camera.cy + np.float32(y)) for x in QUARTERS for y in QUARTERS
    ]
    return np.mean([(1 - shown(row, camera=each).image[..., 3]).sum() for each in moved])


@pytest.mark.parametrize("size", [0.01, 0.02, 0.04])
def test_a_gaussian_smaller_than_a_pixel_covers_as_much_as_it_is_large(size):
    coarse, fine = (pinhole(camera_ahead().scaled(40 * scale, 36 * scale), NEAR) for scale in (1, 8))
    assert covered_by(ball(size=size), coarse) == pytest.approx(covered_by(ball(size=size), fine) / 64, rel=0.1)


def test_bands_and_windows_of_a_picture_are_parts_of_it():
    table, camera = cloud(), camera_ahead()
    table[:, GROUPS["scales"]] -= 0.5  # none reaches farther than the border
    whole = RasterizedView(table, pinhole(camera, NEAR), BACKGROUND).image
    for left, top, right, bottom in ((0, 0, 40, 9), (0, 27, 40, 36), (23, 11, 39, 27)):
        part = replace(camera, width=right - left, height=bottom - top, cx=camera.cx - left, cy=camera.cy - top)
        image = RasterizedView(table, pinhole(part, NEAR), BACKGROUND).image
        assert_allclose(image, whole[top:bottom, left:right], atol=2e-4)


# ---------------------------------------------------------------------------------------------------------------- cores
def test_one_core_and_two_give_the_same_bits(two_cores):
    table = cloud(300, seed=5)
    weights = np.random.default_rng(5).normal(size=(100, 130, 3)).astype(np.float32)
    camera, found = pinhole(camera_ahead(130, 100, 150), NEAR), []
    for count in (1, 2, 3):
        cores.set_core_count(count)
        cores.limit_torch_threads()
        view, gradients = RasterizedView(table, camera, BACKGROUND), np.zeros_like(table)
        view.backward(weights, gradients)
        found.append((view.image, gradients, view.blended(table[:, :3])))
    for others in found[1:]:
        for one, other in zip(found[0], others, strict=True):
            assert_array_equal(one, other)
