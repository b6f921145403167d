"""Rays of pixels, and spaces: a ray's path in the grid is what its points map to."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

torch = pytest.importorskip("torch")

from torch.nn.functional import normalize

from blender_tests.engine.reference.capture_files import random_rotation
from karf_engine.capture.camera import Camera
from karf_engine.capture.distortion import distort
from karf_engine.fields.rendering.rays import PixelDataset, Rays, camera_rays, depth_per_distance, spherical_harmonics
from karf_engine.fields.rendering.sampling import Polylines
from karf_engine.fields.rendering.space import Box, Contraction, Frustum, Similarity, space_from_json, space_to_json

CENTER = torch.tensor([0.5, -1.0, 2.0])


# -------------------------------------------------------------------------------------------------------------------- rays
def random_camera(seed, width, height):
    random = np.random.default_rng(seed)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = random_rotation(random), random.normal(size=3) * 4
    return Camera(width, height, 1.3 * width, 1.1 * width, 0.45 * width, 0.6 * height, pose)


CAMERAS = [random_camera(0, 7, 5), random_camera(1, 4, 9), random_camera(2, 6, 6)]


def test_rays_and_pixels_of_a_dataset_are_those_of_its_photos():
    random = np.random.default_rng(3)
    colors = [random.random((c.height, c.width, 3)) for c in CAMERAS]
    alphas = [random.random((c.height, c.width)) for c in CAMERAS]
    dataset = PixelDataset(CAMERAS, colors, alphas)
    rays = dataset.rays(torch.arange(len(dataset)))
    expected = [camera.rays(camera.pixel_centers()) for camera in CAMERAS]
    directions = np.concatenate([d / np.linalg.norm(d, axis=1, keepdims=True) for _, d in expected])
    assert_allclose(rays.origins, np.concatenate([o for o, _ in expected]), atol=1e-6)
    assert_allclose(rays.viewdirs, directions, atol=1e-6)
    assert_allclose(camera_rays(CAMERAS[0]).viewdirs, directions[:35], atol=1e-6)
    assert dataset.offsets.tolist() == [0, 35, 71, 107]
    index = torch.tensor([70, 0, 106, 35, 34, 71])
    assert dataset.view_indices(index).tolist() == [1, 0, 2, 1, 0, 2]
    assert_allclose(dataset.rays(index).viewdirs, rays.viewdirs[index])
    # the last pixel of the second training image is its lower right corner
    assert_array_equal(dataset.color[70], np.rint(colors[1][8, 3] * 255))
    assert dataset.alpha[70] == np.rint(alphas[1][8, 3] * 255)


@pytest.mark.parametrize("distortion", [(), (-0.2, 0.05, 0.01, -0.01)])
def test_rays_and_depths_follow_the_lens(distortion):
    camera = Camera(16, 12, 13.0, 12.0, 8.3, 5.7, CAMERAS[1].camera_to_world, distortion)
    rays, factors = camera_rays(camera), depth_per_distance(camera)
    points = rays.origins.numpy() + rays.viewdirs.numpy() * (3 / factors)[:, None]
    pixels, depth = camera.without_distortion().project(points.astype(np.float64))
    assert_allclose(distort(camera, pixels) if distortion else pixels, camera.pixel_centers(), atol=1e-3)
    assert_allclose(depth, 3, atol=1e-5)


def test_spherical_harmonics_are_orthonormal_over_the_sphere():
    basis = spherical_harmonics(normalize(random_points(200_000, 1.0), dim=1))
    assert_allclose(4 * np.pi * (basis.T @ basis) / len(basis), np.eye(9), atol=0.02)


# ------------------------------------------------------------------------------------------------------------------ spaces
def contraction(room=1.0):
    return Contraction(CENTER, radius=1.5, room=room, near=0.05)


def frustum():
    """Looks along +y from (1, 2, 3); z is up."""
    pose = torch.eye(4)
    pose[:3, :3] = torch.tensor([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    pose[:3, 3] = torch.tensor([1.0, 2.0, 3.0])
    return Frustum(torch.linalg.inv(pose), torch.tensor([2.4, 2.2]), near=0.8, depth_scale=0.5)


def similarity():
    matrix = torch.eye(4)
    matrix[:3, :3] = 2.5 * torch.tensor([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    matrix[:3, 3] = torch.tensor([1.0, 0.0, -3.0])
    return Similarity(matrix)


def random_points(n, spread, seed=0):
    return spread * torch.randn(n, 3, generator=torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("room", [0.4, 1.0, 2.0])
def test_a_contraction_keeps_its_ball_and_brings_all_else_within_reach(room):
    space = contraction(room)
    near = CENTER + 1.5 * normalize(random_points(50, 1)) * torch.rand(50, 1)
    assert_allclose(space.to_grid(near), (near - CENTER) / 1.5, atol=1e-6)
    far = CENTER + random_points(500, 1000.0)
    norms = torch.linalg.norm(space.to_grid(far), dim=1)
    assert (norms > 1).all() and (norms < 1 + room).all()
    one_and_a_half_out = space.to_grid(CENTER + torch.tensor([[0.0, 3.0, 0.0]]))  # y = 2: 1 + b - b / 2
    assert_allclose(one_and_a_half_out, [[0, 1 + room / 2, 0]], atol=1e-6)


@pytest.mark.parametrize("space", [Box(), similarity(), contraction(), contraction(0.5), frustum()], ids=str)
def test_spaces_are_invertible_and_survive_json(space):
    points = random_points(300, 2.5) + torch.tensor([1.0, 14.0, 3.0])
    assert_allclose(space.to_world(space.to_grid(points)), points, rtol=2e-4, atol=2e-3)
    back = space_from_json(json.loads(json.dumps(space_to_json(space))))
    assert type(back) is type(space)
    assert np.array_equal(back.to_grid(points), space.to_grid(points))


def test_a_frustum_has_its_near_plane_in_front_and_infinity_at_the_back():
    space = frustum()
    on_axis = torch.tensor([[1.0, 2.8, 3.0], [1.0, 1e7, 3.0]])
    assert_allclose(space.to_grid(on_axis), [[0, 0, -0.5], [0, 0, 0.5]], atol=1e-5)
    beside = torch.tensor([[1.0 + 1 / 2.4, 3.0, 3.0], [1.0, 3.0, 3.0 + 1 / 2.2]])  # at depth one
    assert_allclose(space.to_grid(beside)[:, :2], [[1, 0], [0, 1]], atol=1e-5)


@pytest.mark.parametrize("space", [contraction(), frustum()], ids=str)
def test_a_path_is_where_the_points_of_its_ray_map_to(space):
    viewdirs = normalize(torch.tensor([0.0, 1.0, 0.0]) + random_points(60, 0.2), dim=1)
    rays = Rays(torch.tensor([1.0, 2.0, 3.0]) + random_points(60, 0.1, 1), viewdirs)
    lines = Polylines(space.paths(rays, torch.full((3,), -9.0), torch.full((3,), 9.0)))
    for distance in (1.5, 4.0, 20.0, 300.0):
        _, gap = lines.nearest(space.to_grid(rays.origins + distance * viewdirs))
        assert gap.max() < 4e-3


def test_the_knots_of_a_contracted_path_are_close_together():
    rays = Rays(CENTER + random_points(80, 2.0, 1), normalize(random_points(80, 1.0), dim=1))
    paths = contraction().paths(rays, torch.full((3,), -2.0), torch.full((3,), 2.0))
    assert torch.linalg.norm(paths[:, 1:] - paths[:, :-1], dim=2).max() < 0.12


def test_a_backward_ray_has_no_path_in_a_frustum():
    rays = Rays(torch.tensor([[1.0, 2.0, 3.0]]), torch.tensor([[0.0, -1.0, 0.0]]))
    assert Polylines(frustum().paths(rays, torch.full((3,), -1.0), torch.full((3,), 1.0))).lengths.item() == 0


@pytest.mark.parametrize("space", [Box(), similarity(), frustum()], ids=str)
def test_lines_are_the_grid_coordinates_of_a_rays_points(space):
    viewdirs = normalize(random_points(40, 0.3) + torch.tensor([0.0, 1.0, 0.0]), dim=1)
    rays = Rays(torch.tensor([[1.2, 1.9, 3.1]]).repeat(40, 1), viewdirs)
    origins, directions = space.to_grid_rays(rays)
    at = space.to_grid(rays.origins + 4.0 * rays.viewdirs) - origins
    assert_allclose(torch.linalg.cross(at, directions), np.zeros((40, 3)), atol=2e-4)
    if not isinstance(space, Frustum):  # there t is the distance
        assert_allclose(at, 4 * directions, atol=1e-5)
        step = space.to_grid(rays.origins + rays.viewdirs) - space.to_grid(rays.origins)
        assert_allclose(space.rotate_directions(rays.viewdirs), normalize(step, dim=1), atol=1e-5)
