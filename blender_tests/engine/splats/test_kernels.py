"""The kernels render the pictures and gradients of the reference, bit-identically on any number of cores."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose, assert_array_equal

pytest.importorskip("numba")

from blender_tests.engine.splats.clouds import BACKGROUND, GROUPS, NEAR, ball, camera_ahead, cloud
from blender_tests.engine.splats.torch_splats import splat
from karf_engine.compute import cores
from karf_engine.errors import OutOfMemory
from karf_engine.splats.compiled import CompiledView
from karf_engine.splats.kernels.arrays import ANTIALIASED_FILTER, BORDER, LOGIT, PIXEL_FILTER, PLAIN_FILTER, ROTATION
from karf_engine.splats.rasterizer import pinhole

CAMERA = pinhole(camera_ahead(), NEAR)


def shown(*rows, camera=CAMERA):
    return CompiledView(np.stack(rows), camera, BACKGROUND)


FILTERS = {"own": PIXEL_FILTER, "plain": PLAIN_FILTER, "antialiased": ANTIALIASED_FILTER}
CASES = {f"{name}, {degree}": (cloud(degree=degree), FILTERS[name], 3e-5) for name in FILTERS for degree in range(4)}
CASES |= {"occluding": (cloud(30, 0, seed=3), PIXEL_FILTER, 1e-4)}
CASES["occluding"][0][:, LOGIT] = 3.0


@pytest.mark.parametrize("case", CASES)
def test_picture_and_gradients_match_the_reference(case):
    table, screen_filter, tolerance = CASES[case]
    camera = pinhole(camera_ahead(), NEAR, screen_filter)
    view, variable = shown(*table, camera=camera), torch.from_numpy(table).double().requires_grad_()
    truth = splat(variable, camera, BACKGROUND)
    assert_allclose(view.image, truth.detach(), atol=1e-5)
    weights = np.random.default_rng(1).normal(size=(36, 40, 3)).astype(np.float32)
    by_kernels = np.zeros_like(table)
    view.backward(weights, by_kernels)
    (truth[..., :3] * torch.from_numpy(weights)).sum().backward()
    by_torch = variable.grad.numpy()
    for name, columns in GROUPS.items():
        own = by_torch[:, columns]
        assert own.size == 0 or abs(own).max() > 0.05, f"the picture does not depend on the {name}"
        assert_allclose(by_kernels[:, columns], own, atol=tolerance * abs(by_torch).max(), err_msg=name)


def test_invisible_gaussians_have_no_gradient():
    table = np.stack([ball(), ball((0, 0, 9))])
    gradients = np.full_like(table, 7)
    shown(*table).backward(np.ones((36, 40, 3), np.float32), gradients)
    assert (gradients[1] == 7).all() and not (gradients[0] == 7).any()


@pytest.mark.parametrize(
    "rows", [[], *([ball(place, 0.02)] for place in ((0, 0, 4.5), (0, 0, 3.9), (30, 0, 0), (0, -30, 0)))]
)
def test_gaussians_behind_too_near_or_outside_are_invisible(rows):
    view = CompiledView(np.array(rows) if rows else cloud(0), CAMERA, BACKGROUND)
    assert view.offsets[-1] == 0
    assert_array_equal(view.image, np.broadcast_to(np.float32([*BACKGROUND, 1]), (36, 40, 4)))


def test_large_gaussian_outside_the_picture_reaches_into_it():
    beside = 4 * (20 + 0.9 * BORDER * 40) / 50
    assert shown(ball((beside, 0, 0), 0.6)).image[..., 3].min() < 0.9


def test_nearer_gaussians_hide_farther_ones_in_any_order():
    red, blue = ball((0, 0, 1), 0.3, 0.98, (1, 0, 0)), ball((0, 0, -1), 0.3, 0.98, (0, 0, 1))
    first, second = shown(red, blue).image, shown(blue, red).image
    assert_array_equal(first, second)
    assert first[18, 20, 0] > 0.9 > 0.1 > first[18, 20, 2]


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf, 1e30, -1e30, 200])
def test_degenerate_gaussians_are_invisible(wrong):
    plain = ball((0.3, 0.1, 0), 0.1)
    alone = shown(plain).image
    for column in range(LOGIT):
        strange = ball()
        strange[column] = wrong
        image = shown(plain, strange).image
        assert image.shape == alone.shape and np.isfinite(image).all(), column
    zero_rotation = ball()
    zero_rotation[ROTATION:LOGIT] = 0
    assert_array_equal(shown(plain, zero_rotation).image, alone)


def test_too_many_tiles_are_rejected():
    """More tiles than 32 bits can count would write outside their array."""
    camera = camera_ahead().scaled(4096, 4096)
    wide = np.repeat(ball((0, 0, 0), 50.0, 0.9, (1, 1, 1))[None], 40_000, 0)
    with pytest.raises(OutOfMemory, match="40000 Gaussians cover too much of a picture of 4096x4096 pixels"):
        CompiledView(wide, pinhole(camera, NEAR), BACKGROUND)


def test_blended_values_match_the_picture():
    view = shown(*cloud())
    assert_allclose(view.blended(np.ones((60, 1), np.float32))[0], 1 - view.image[..., 3], atol=1e-6)
    colors = np.moveaxis(view.blended(view.colors), 0, -1) + view.image[..., 3:] * np.float32(BACKGROUND)
    assert_allclose(colors, view.image[..., :3], atol=1e-5)
    assert_allclose(view.weights(), view.blended(np.eye(60, dtype=np.float32)).sum((1, 2)), rtol=1e-4, atol=1e-4)


def covered_by(row, scale):
    """Return how many pixels a Gaussian covers in an enlarged picture, averaged over positions within a pixel."""
    camera, shifts = pinhole(camera_ahead().scaled(40 * scale, 36 * scale), NEAR), np.arange(0, 1, 0.25, np.float32)
    moved = [camera._replace(cx=camera.cx + x, cy=camera.cy + y) for x in shifts for y in shifts]
    return np.mean([(1 - shown(row, camera=each).image[..., 3]).sum() for each in moved])


@pytest.mark.parametrize("size", [0.01, 0.02, 0.04])
def test_subpixel_gaussian_covers_its_true_area(size):
    row = ball(size=size)
    assert covered_by(row, 1) == pytest.approx(covered_by(row, 8) / 64, rel=0.1)


def test_rendered_windows_match_the_whole_picture():
    table, camera = cloud(), camera_ahead()
    table[:, GROUPS["scales"]] -= 0.5  # none reaches farther than the border
    whole = CompiledView(table, pinhole(camera, NEAR), BACKGROUND).image
    for left, top, right, bottom in ((0, 0, 40, 9), (0, 27, 40, 36), (23, 11, 39, 27)):
        part = replace(camera, width=right - left, height=bottom - top, cx=camera.cx - left, cy=camera.cy - top)
        image = CompiledView(table, pinhole(part, NEAR), BACKGROUND).image
        assert_allclose(image, whole[top:bottom, left:right], atol=2e-4)


def test_core_count_changes_no_bit():
    table, found, before = cloud(300, seed=5), [], cores.core_count()
    weights = np.random.default_rng(5).normal(size=(100, 130, 3)).astype(np.float32)
    camera = pinhole(camera_ahead(130, 100, 150), NEAR)
    try:
        for count in (1, 2, 3):
            cores.set_core_count(count)
            cores.limit_torch_threads()
            view, gradients = CompiledView(table, camera, BACKGROUND), np.zeros_like(table)
            view.backward(weights, gradients)
            found.append((view.image, gradients, view.blended(table[:, :3])))
    finally:
        cores.set_core_count(before)
    for arrays in zip(*found, strict=True):
        for other in arrays[1:]:
            assert_array_equal(arrays[0], other)
