"""Cameras, depth bounds, sparse points and consistent photos limit where a scene can be."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from blender_tests.engine.fields.fitting import observed_by_all, pixel_dataset, views_of
from blender_tests.engine.reference.still_life import BALL_CENTER, BALL_RADIUS, camera_at, cameras, take_photo
from karf_engine.compute.runtime import start_runtime
from karf_engine.fields import extent, priors
from karf_engine.fields.priors import CLEAR_SHARE, FREE_SHARE, clear_radii, free_depths
from karf_engine.fields.rendering.rays import PixelDataset, camera_rays
from karf_engine.fields.rendering.space import Box, Contraction
from karf_engine.fields.voxels.fit_box import start_box_fit
from karf_engine.fields.voxels.fit_open import fit_sky
from karf_engine.project.settings import GeometrySettings, OpenSettings

ORIGIN = torch.zeros(3)


def zoomed(camera, factor):
    return replace(camera, fx=factor * camera.fx, fy=factor * camera.fy)


def test_pixels_per_voxel_follow_from_projection():
    camera, place = camera_at(0.0, 0.3), np.array([[0.2, -0.1, 0.1]])
    _, depth = camera.project(place)
    for space, grid_scale in ((Box(), 1), (Contraction(torch.zeros(3), 0.5, 1.0, 0.1), 0.5)):
        found = extent.pixels_per_voxel(space, 0.1, place, camera)
        np.testing.assert_allclose(found, grid_scale * 0.1 * camera.fx / depth, rtol=1e-3)
    assert np.isnan(extent.pixels_per_voxel(Box(), 0.1, 2 * camera.position[None], camera)).all()


def test_focal_length_does_not_change_pixels_per_voxel():
    wide, tele = (extent.contraction_around_focus([zoomed(c, f) for c in cameras(12)], OpenSettings()) for f in (1, 4))
    assert wide.radius == pytest.approx(4 * tele.radius)
    camera, focus = camera_at(0.0, 0.3), np.zeros((1, 3))
    of_tele = extent.pixels_per_voxel(tele, 0.02, focus, zoomed(camera, 4))
    np.testing.assert_allclose(extent.pixels_per_voxel(wide, 0.02, focus, camera), of_tele, rtol=1e-4)


def test_typical_voxel_lies_at_points_or_the_focus():
    views = views_of(cameras(6))

    def typical(points):
        return extent.typical_pixels_per_voxel(Box(), 0.1, views, points)

    at_focus = pytest.approx(0.1 * views[0].camera.fx / 3.6, rel=1e-3)
    assert typical(None) == typical(observed_by_all(np.zeros((0, 3)), 6)) == at_focus
    assert typical(observed_by_all(np.array([[0.0, 0.0, 0.5]]), 6)) > 1.05 * typical(None)


def test_detail_finer_than_a_voxel_is_removed():
    stripes = np.zeros((64, 64, 3))
    stripes[:, ::2] = 1
    np.testing.assert_allclose(extent.remove_detail(stripes, 2.0), 0.5)
    np.testing.assert_array_equal(extent.remove_detail(stripes, 1.0), stripes)
    smooth = np.tile(np.linspace(0, 1, 64)[:, None, None], (1, 64, 3))
    fine, coarse = extent.psnr_without_detail([stripes, smooth], 4.0)
    assert fine == pytest.approx(6.02, abs=0.1) and coarse > 40


def is_free(views, places, points=None):
    places = torch.tensor(np.array(places), dtype=torch.float32)
    return priors.FreeSpace.from_views(views, points).contains(places).tolist()


def bounded(camera, nearest):
    return replace(views_of([camera])[0], depth_bounds=(nearest / FREE_SHARE, 99.0))


def ball_of_points(n=400, radius=1.0):
    directions = np.random.default_rng(0).normal(size=(n, 3))
    return radius * directions / np.linalg.norm(directions, axis=1, keepdims=True)


def test_visible_space_before_the_nearest_depth_is_free():
    camera = camera_at(0.0, 0.0)  # at x = 3.6, looks at the origin
    ahead, beside, behind, beyond = [2.0, 0, 0], [2.0, 1.5, 0], [4.5, 0, 0], [0.5, 0, 0]
    places = [ahead, beside, behind, beyond]
    assert is_free([bounded(camera, 2.5)], places) == [True, False, False, False]
    assert not any(is_free(views_of([camera]), places))
    opposite = camera_at(np.pi, 0.0)
    assert is_free([bounded(camera, 0.5), bounded(opposite, 3.7)], places) == [False, False, False, False]
    assert is_free([bounded(camera, 0.5), bounded(opposite, 4.2)], places) == [False, False, False, True]


def test_space_around_cameras_is_free_up_to_half_the_nearest_distance():
    views = views_of(cameras(6))
    points = observed_by_all(ball_of_points(), 6)
    position = views[0].camera.position
    assert clear_radii([views[0].camera], points) == [pytest.approx(CLEAR_SHARE * (3.6 - 1), abs=0.1)]
    back = position / np.linalg.norm(position)
    assert is_free(views, [position + 1.1 * back, position + 1.6 * back], points) == [True, False]
    behind_it = observed_by_all(np.concatenate([ball_of_points(), position + back + 0.01 * ball_of_points(20)]), 6)
    assert is_free(views, [position + 0.4 * back, position + 0.8 * back], behind_it) == [True, False]
    assert clear_radii([views[0].camera], observed_by_all(ball_of_points(40), 6)) == [0.0]


def test_free_depth_follows_from_points_or_depth_bounds():
    views = views_of(cameras(6))
    bounds = [replace(view, depth_bounds=(nearest, 9.0)) for view, nearest in zip(views[:2], (2.0, 3.0), strict=True)]
    assert free_depths([views[0], *bounds], None) == [0.0, FREE_SHARE * 2.0, FREE_SHARE * 3.0]
    of_points = pytest.approx(FREE_SHARE * 2.6, abs=0.1)
    assert free_depths([views[0], bounds[0]], observed_by_all(ball_of_points(), 3)) == [of_points, FREE_SHARE * 2.0]
    assert free_depths(views, observed_by_all(ball_of_points(40), 6))[0] == 0.0
    points = observed_by_all(np.concatenate([ball_of_points(100, 0.5), ball_of_points(900, 8.0)]), 6)
    kept = (points.view != 0) | (points.point >= 100)
    blind = replace(points, view=points.view[kept], point=points.point[kept])  # view 0 does not observe near points
    assert free_depths(views, blind)[0] == free_depths(views, points)[0] < 3.2
    points = observed_by_all(np.concatenate([0.5 * views[0].camera.position[None], ball_of_points(300)]), 6)
    assert free_depths(views, points)[0] > FREE_SHARE * 2.4, "one mistaken point counts"
    inexact = replace(points, errors=np.where(np.arange(301) < 250, 9.0, 0.2).astype(np.float32))
    assert free_depths(views, inexact)[0] > 0
    assert free_depths(views, points.seen_by([0, 1])) == [0.0] * 6


LOW = [camera_at(2 * np.pi * n / 8, 0.1) for n in range(8)]  # their photos show the horizon


def horizon(*positions):
    points = observed_by_all(np.array(positions), len(LOW)) if positions else None
    return priors.estimate_horizon(LOW, points, ORIGIN, 2.0)


def is_sky(points, *angles):
    """Test whether there is sky at these azimuths and elevations in degrees."""
    backs = np.stack([camera_at(*np.radians(each)).camera_to_world[:3, 2] for each in angles])
    return horizon(*points).is_sky(torch.from_numpy(backs).float()).tolist()


def take_photos(color_of):
    """Photos, two in each direction, whose colors are a function of the rays."""
    cameras = LOW + [camera_at(2 * np.pi * n / 8, 0.1, distance=5.0) for n in range(8)]
    return PixelDataset(cameras, [color_of(camera_rays(camera)).view(32, 32, 3).numpy() for camera in cameras], None)


def gradient(rays):
    return 0.5 + 0.4 * rays.viewdirs


def test_sky_begins_above_the_horizon_and_distant_points():
    hill, near = (60.0, 0.0, 15.0), (0.0, 0.0, 1.8)  # 14 degrees above the horizon; where the cameras look
    assert is_sky([], (50, 3), (50, -3)) == [True, False]
    assert is_sky([hill], (0, 10), (0, 20), (180, 10)) == [False, True, True]
    assert is_sky([near], (0, 10)) == [True]


def test_partly_hidden_sky_is_learned():
    random = torch.Generator().manual_seed(0)

    def partly_hidden(rays):
        hidden = torch.rand(len(rays), 1, generator=random) < 0.15
        return torch.where(hidden, torch.tensor([0.9, 0.1, 0.1]), gradient(rays))

    sky = fit_sky(take_photos(partly_hidden), horizon(), start_runtime(0, 1, "cpu"))
    rays = camera_rays(LOW[3])
    above = horizon().is_sky(rays.viewdirs)
    assert (sky(rays.viewdirs) - gradient(rays))[above].abs().mean() < 0.05


def test_near_wall_is_not_learned_as_sky():
    near_wall = take_photos(lambda rays: 0.5 + 0.5 * torch.sin(6 * rays.origins))
    assert fit_sky(near_wall, horizon(), start_runtime(0, 1, "cpu")) is None


def test_few_cameras_all_around_have_wide_baselines():
    rigs = (cameras(12), cameras(40), [camera_at(0.1 * number, 0.5) for number in range(14)], cameras(2))
    assert [extent.is_wide_baseline(rig, ORIGIN) for rig in rigs] == [True, False, False, False]


def test_surface_points_are_photo_consistent():
    dataset = pixel_dataset([take_photo(camera, sky=True) for camera in cameras(12)], "opaque")
    up = np.random.default_rng(0).normal(size=(300, 3)) * (0.6, 0.6, 0.2) + (-0.5, 0, 1.5)
    top = BALL_CENTER + BALL_RADIUS * up / np.linalg.norm(up, axis=1, keepdims=True)  # nothing hides it
    noise = torch.randn(300, 3, generator=torch.Generator().manual_seed(0))
    before_a_camera = torch.from_numpy(0.75 * dataset.cameras[0].position).float() + 0.1 * noise
    assert priors.is_photo_consistent(dataset, torch.from_numpy(top).float(), 0.05).float().mean() > 0.9
    assert priors.is_photo_consistent(dataset, before_a_camera, 0.05).float().mean() < 0.1


def test_rotating_about_the_vertical_keeps_elevations():
    axes = torch.from_numpy(extent.upright_axes(cameras(12))).float()
    viewdirs = torch.nn.functional.normalize(torch.randn(50, 3, generator=torch.Generator().manual_seed(0)), dim=1)
    result = priors.rotate_about_vertical(viewdirs, axes, torch.linspace(0, 1, 50))
    assert torch.allclose(result @ axes[2], viewdirs @ axes[2], atol=1e-6)
    assert torch.allclose(result.norm(dim=1), torch.ones(50), atol=1e-6)
    assert (result - viewdirs).norm(dim=1).max() > 1


def test_inconsistent_photos_leave_every_cell_occupied():
    colors = [np.full((32, 32, 3), number / 5) for number in range(6)]  # different grays
    dataset, settings = PixelDataset(cameras(6), colors, None, None), GeometrySettings()
    assert start_box_fit(dataset, "opaque", settings, start_runtime(0, 1, "cpu")).field.occupied.all()
