"""A tiny NeRF learns the still life in seconds, on every kind of background."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose

from blender_tests.engine.fields.fitting import observed_by_all, pixel_dataset, silent
from blender_tests.engine.reference.nerf import still_life
from blender_tests.engine.reference.still_life import camera_at, take_photo
from karf_engine.compute.runtime import start_runtime
from karf_engine.fields.fit import FitInputs
from karf_engine.fields.nerf.field import NerfSampling
from karf_engine.fields.nerf.fit import NerfFit, choose_space_and_sampling
from karf_engine.fields.registry import field_kind
from karf_engine.fields.rendering.rays import camera_rays
from karf_engine.fields.rendering.space import Box, Frustum
from karf_engine.metrics.images import psnr
from karf_engine.project.settings import GeometrySettings, NerfSettings, preset

TINY = NerfSettings(depth=3, width=32, position_frequencies=6, direction_frequencies=2, coarse_samples=16,
                    fine_samples=16, iterations=600, rays=64, rate=5e-3, decay_steps=1000, crop_iterations=20,
                    look_every=600)  # fmt: skip


def start(kind, settings=TINY, space="box", device="cpu", views=None):
    found, photos = still_life(sky=kind == "opaque")
    geometry, runtime = GeometrySettings(field="nerf", nerf=settings), start_runtime(0, 1, str(device))
    inputs = FitInputs(pixel_dataset(photos, kind, device), kind, space, views or found, None, geometry, runtime)
    return field_kind("nerf").start(inputs)


@pytest.fixture(scope="module")
def learned():
    return list(start("black").scenes(silent()))[-1]


def test_held_out_view_is_rendered_well(learned):
    truth = take_photo(camera_at(0.3, 0.6))
    picture = learned.render(truth.camera, 3)
    assert psnr(picture.color.numpy(), truth.color) >= 22
    assert picture.opacity.numpy()[truth.alpha > 0.99].mean() > 0.9
    # the central pixel shows the scene's center: the camera is 3.6 away, the block reaches 0.75 toward it
    assert 2.6 < picture.depth[16, 16] < 4.2


def test_fresh_networks_have_density_to_learn_from():
    field = start("black", NerfSettings()).field
    assert (field.density(torch.rand(1000, 3) * 2 - 1) > 0).float().mean() > 0.9


@pytest.mark.on_device("NeRFs")
@pytest.mark.parametrize("kind", ["alpha", "opaque"])
def test_alpha_and_opaque_backgrounds_are_learned(kind, device):
    scene = list(start(kind, replace(TINY, iterations=400), device=device).scenes(silent()))[-1]
    truth = take_photo(camera_at(0.3, 0.6), kind == "opaque")
    picture = scene.render(truth.camera, 1)
    assert psnr(picture.color.cpu().numpy(), truth.color + (1 - truth.alpha[..., None])) >= 16
    if kind == "alpha":  # a white object looks like the white ground, so empty pixels are only less opaque
        opacity = picture.opacity.cpu().numpy()
        assert opacity[truth.alpha > 0.99].mean() > 0.4 + opacity[truth.alpha < 0.01].mean()


def test_field_has_normals_and_features_for_later_stages(learned):
    field, surface = learned.field, learned.render(camera_at(0.3, 0.6), 3).cache
    middle = surface.positions[:, 1]
    assert ((middle > field.bounds[0]) & (middle < field.bounds[1])).all(1).float().mean() > 0.95
    normals = field.normals(middle)
    assert_allclose(torch.linalg.norm(normals, dim=1), np.ones(len(middle)), atol=1e-4)
    toward_camera = -(normals * field.space.rotate_directions(surface.viewdirs)).sum(1)
    assert toward_camera.median() > 0.2
    assert field.features(middle).shape == (len(middle), 32)


@pytest.mark.parametrize(
    ("iterations", "decay_steps", "expected"),
    [(101, 100, 1e-3 * 0.1 ** (np.arange(101) / 100)), (10, 0, np.full(10, 1e-3))],
)
def test_scenes_come_at_the_set_interval_and_the_rate_falls(iterations, decay_steps, expected, monkeypatch):
    rates, ends = [], []

    def record(training_state, until, step, schedule, progress, checkpoint):
        rate = training_state.optimizer.param_groups[0]["lr"]
        rates.extend(rate * schedule(i, training_state.iterations) for i in range(training_state.done, until))
        ends.append(until)
        training_state.done = until

    monkeypatch.setattr("karf_engine.fields.nerf.fit.train", record)
    fit = start("black", replace(TINY, iterations=iterations, look_every=40, rate=1e-3, decay_steps=decay_steps))
    assert fit.iterations == iterations
    assert len(list(fit.scenes(silent()))) == len(ends)
    assert ends == [end for end in (40, 80) if end < iterations] + [iterations]
    assert_allclose(rates, expected)


def test_first_rays_pass_through_the_middle_of_photos():
    dataset = pixel_dataset(still_life(3, 32)[1], "black")
    index = dataset.draw_central(4000, 0.5, start_runtime(0, 1, "cpu"))
    column, row = index % 32, index % (32 * 32) // 32
    assert (column.min(), column.max(), row.min(), row.max()) == (8, 23, 8, 23)
    assert torch.bincount(dataset.view_indices(index)).min() > 1000


def test_cut_out_objects_are_sampled_around_the_camera_distance():
    views, _ = still_life()
    space, sampling = choose_space_and_sampling("alpha", "box", views, None, preset("paper").geometry.nerf)
    assert (sampling.near, sampling.far) == pytest.approx((1.8, 5.4), rel=1e-4)
    assert (sampling.coarse, sampling.fine, sampling.in_disparity) == (64, 128, False)
    positions = space.to_grid(torch.tensor(np.stack([v.camera.position for v in views])).float())
    assert_allclose(torch.linalg.norm(positions, dim=1), np.full(20, 4.0), rtol=1e-4)


def test_open_scenes_are_sampled_in_disparity():
    views, _ = still_life(2)
    positions = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], *[[-0.5, 0.1, 0.0]] * 9])
    points = observed_by_all(positions, 2)
    _, sampling = choose_space_and_sampling("opaque", "contraction", views, points, TINY)
    depths = np.stack([v.camera.project(positions)[1] for v in views])
    assert sampling.in_disparity
    assert sampling.near == pytest.approx(0.9 * depths.min(), rel=0.05)
    assert sampling.far == pytest.approx(1.1 * depths.max(), rel=0.05)
    settings = replace(TINY, near=0.25, far=80.0)
    _, sampling = choose_space_and_sampling("opaque", "contraction", views, points, settings)
    assert (sampling.near, sampling.far) == (0.25, 80.0)


def test_forward_facing_captures_use_ndc_and_density_noise():
    views = [replace(view, depth_bounds=(2.0, 40.0)) for view in still_life()[0]]
    space, sampling = choose_space_and_sampling("opaque", "frustum", views[:1], None, TINY)
    assert isinstance(space, Frustum) and space.near == pytest.approx(1.5)
    assert (sampling.near, sampling.far, sampling.in_disparity) == (0.0, 1.0, False)
    # the corners of the picture lie at +-1 on the near plane and at infinity
    corners = camera_rays(views[0].camera)[torch.tensor([0, 31, 32 * 31, 32 * 32 - 1])]
    first, directions = space.to_grid_rays(corners)
    assert_allclose(first[:, 2], -np.ones(4), atol=1e-5)
    assert_allclose((first + directions)[:, 2], np.ones(4), atol=1e-5)
    assert_allclose(first[:, :2].abs(), np.full((4, 2), 31 / 32), atol=1e-4)
    fit = start("opaque", replace(TINY, iterations=2), "frustum", views=views)
    before, t = fit.runtime.generator.get_state(), fit.field.coarse_t(torch.zeros(4, 0))
    noisy = fit._pass(fit.field.fine, space.to_grid_rays(corners), corners.viewdirs, t)
    assert not torch.equal(before, fit.runtime.generator.get_state()) and torch.isfinite(noisy[0]).all()


def test_empty_rays_of_cut_out_objects_are_white():
    dataset, sampling = pixel_dataset(still_life(2)[1], "alpha"), NerfSampling(2.0, 5.0, coarse=8, fine=8)
    fit = NerfFit(dataset, "alpha", Box(), sampling, TINY, start_runtime(0, 1, "cpu"))
    for network in (fit.field.coarse, fit.field.fine):
        network.alpha_linear.bias.data[:] = -100.0
    for colors in fit._render(dataset.rays(torch.arange(5))):
        assert_allclose(colors.detach(), np.ones((5, 3)))
