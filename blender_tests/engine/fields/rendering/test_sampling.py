"""Rays, spaces and samples agree with cameras, closed forms and brute force."""

import json

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose, assert_array_equal
from torch.nn.functional import normalize

from blender_tests.engine.reference.capture_files import random_rotation
from blender_tests.engine.reference.rays import march_one
from karf_engine.capture.camera import Camera
from karf_engine.capture.distortion import distort
from karf_engine.fields.rendering import sampling
from karf_engine.fields.rendering.rays import PixelDataset, Rays, camera_rays, depth_per_distance, spherical_harmonics
from karf_engine.fields.rendering.space import (
    Box,
    Contraction,
    Frustum,
    Similarity,
    clipped_paths,
    space_from_json,
    space_to_json,
)
from karf_engine.fields.rendering.volume import ray_weights_from_sigmas

CENTER, ORIGIN = torch.tensor([0.5, -1.0, 2.0]), torch.zeros(3)


MINIMUM, VOXEL = np.array([-1.0, 0.5, -0.3]), 0.17
N_RAYS = 300
FULL = torch.ones(4, 4, 4, dtype=torch.bool)


def random_camera(seed, width, height):
    random = np.random.default_rng(seed)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = random_rotation(random), random.normal(size=3) * 4
    return Camera(width, height, 1.3 * width, 1.1 * width, 0.45 * width, 0.6 * height, pose)


CAMERAS = [random_camera(0, 7, 5), random_camera(1, 4, 9), random_camera(2, 6, 6)]


def test_dataset_has_the_rays_and_pixels_of_its_photos():
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
def test_rays_and_depths_follow_lens_distortion(distortion):
    camera = Camera(16, 12, 13.0, 12.0, 8.3, 5.7, CAMERAS[1].camera_to_world, distortion)
    rays, factors = camera_rays(camera), depth_per_distance(camera)
    points = rays.origins.numpy() + rays.viewdirs.numpy() * (3 / factors)[:, None]
    pixels, depth = camera.without_distortion().project(points.astype(np.float64))
    assert_allclose(distort(camera, pixels) if distortion else pixels, camera.pixel_centers(), atol=1e-3)
    assert_allclose(depth, 3, atol=1e-5)


def test_spherical_harmonics_are_orthonormal():
    basis = spherical_harmonics(normalize(random_points(200_000, 1.0), dim=1))
    assert_allclose(4 * np.pi * (basis.T @ basis) / len(basis), np.eye(9), atol=0.02)


def contraction(room=1.0):
    return Contraction(CENTER, radius=1.5, room=room, near=0.05)


def frustum():
    """Looks along +y from (1, 2, 3); z is up."""
    pose = torch.tensor([[1.0, 0, 0, 1], [0, 0, -1, 2], [0, 1, 0, 3], [0, 0, 0, 1]])
    return Frustum(torch.linalg.inv(pose), torch.tensor([2.4, 2.2]), near=0.8, depth_scale=0.5)


def similarity():
    return Similarity(torch.tensor([[0.0, -2.5, 0, 1], [2.5, 0, 0, 0], [0, 0, 2.5, -3], [0, 0, 0, 1]]))


def paths_in_cube(space, rays, half_width):
    return space.paths(rays, torch.full((3,), -half_width), torch.full((3,), half_width))


def march(paths, occupied, step, minimum=ORIGIN, voxel=1.0, jitter=None):
    return sampling.march(paths, minimum, voxel, occupied, sampling.coarse_occupancy(occupied), step, jitter)


def random_points(n, spread, seed=0):
    return spread * torch.randn(n, 3, generator=torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("room", [0.4, 1.0, 2.0])
def test_contraction_keeps_its_ball_and_bounds_all_other_space(room):
    space = contraction(room)
    near = CENTER + 1.5 * normalize(random_points(50, 1)) * torch.rand(50, 1)
    assert_allclose(space.to_grid(near), (near - CENTER) / 1.5, atol=1e-6)
    norms = torch.linalg.norm(space.to_grid(CENTER + random_points(500, 1000.0)), dim=1)
    assert (norms > 1).all() and (norms < 1 + room).all()
    at_two_radii = space.to_grid(CENTER + torch.tensor([[0.0, 3.0, 0.0]]))
    assert_allclose(at_two_radii, [[0, 1 + room - room / 2, 0]], atol=1e-6)


@pytest.mark.parametrize("space", [Box(), similarity(), contraction(), contraction(0.5), frustum()], ids=str)
def test_spaces_are_invertible_and_survive_json(space):
    points = random_points(300, 2.5) + torch.tensor([1.0, 14.0, 3.0])
    assert_allclose(space.to_world(space.to_grid(points)), points, rtol=2e-4, atol=2e-3)
    loaded = space_from_json(json.loads(json.dumps(space_to_json(space))))
    assert type(loaded) is type(space)
    assert np.array_equal(loaded.to_grid(points), space.to_grid(points))


def test_frustum_reaches_from_its_near_plane_to_infinity():
    space = frustum()
    on_axis = torch.tensor([[1.0, 2.8, 3.0], [1.0, 1e7, 3.0]])
    assert_allclose(space.to_grid(on_axis), [[0, 0, -0.5], [0, 0, 0.5]], atol=1e-5)
    beside = torch.tensor([[1.0 + 1 / 2.4, 3.0, 3.0], [1.0, 3.0, 3.0 + 1 / 2.2]])  # at depth one
    assert_allclose(space.to_grid(beside)[:, :2], [[1, 0], [0, 1]], atol=1e-5)


@pytest.mark.parametrize("space", [contraction(), frustum()], ids=str)
def test_paths_follow_the_mapped_points_of_their_rays(space):
    viewdirs = normalize(torch.tensor([0.0, 1.0, 0.0]) + random_points(60, 0.2), dim=1)
    rays = Rays(torch.tensor([1.0, 2.0, 3.0]) + random_points(60, 0.1, 1), viewdirs)
    lines = sampling.Polylines(paths_in_cube(space, rays, 9.0))
    for distance in (1.5, 4.0, 20.0, 300.0):
        _, gap = lines.nearest(space.to_grid(rays.origins + distance * viewdirs))
        assert gap.max() < 4e-3


def test_knots_of_contracted_paths_are_close_together():
    rays = Rays(CENTER + random_points(80, 2.0, 1), normalize(random_points(80, 1.0), dim=1))
    assert torch.linalg.norm(paths_in_cube(contraction(), rays, 2.0).diff(dim=1), dim=2).max() < 0.12


def test_backward_ray_has_no_path_in_a_frustum():
    rays = Rays(torch.tensor([[1.0, 2.0, 3.0]]), torch.tensor([[0.0, -1.0, 0.0]]))
    assert sampling.Polylines(paths_in_cube(frustum(), rays, 1.0)).lengths.item() == 0


@pytest.mark.parametrize("space", [Box(), similarity(), frustum()], ids=str)
def test_grid_rays_pass_through_the_mapped_points_of_rays(space):
    viewdirs = normalize(random_points(40, 0.3) + torch.tensor([0.0, 1.0, 0.0]), dim=1)
    rays = Rays(torch.tensor([[1.2, 1.9, 3.1]]).repeat(40, 1), viewdirs)
    origins, directions = space.to_grid_rays(rays)
    offsets = space.to_grid(rays.origins + 4.0 * rays.viewdirs) - origins
    assert_allclose(torch.linalg.cross(offsets, directions), np.zeros((40, 3)), atol=2e-4)
    if not isinstance(space, Frustum):  # where equal distances become equal steps
        assert_allclose(offsets, 4 * directions, atol=1e-5)
        step = space.to_grid(rays.origins + rays.viewdirs) - space.to_grid(rays.origins)
        assert_allclose(space.rotate_directions(rays.viewdirs), normalize(step, dim=1), atol=1e-5)


def random_rays(random, shape):
    """Rays from all around to random points of the box; some start inside, some run along an axis, some miss."""
    size = VOXEL * np.array(shape)
    targets = MINIMUM + random.uniform(0.02, 0.98, (N_RAYS, 3)) * size
    origins = MINIMUM + size / 2 + random.normal(size=(N_RAYS, 3)) * size
    viewdirs = targets - origins
    axes = np.eye(3)[random.integers(0, 3, N_RAYS)] * random.choice([-1.0, 1.0], (N_RAYS, 1))
    viewdirs[::4] = axes[::4]
    origins[::5] = targets[::5]
    viewdirs[7::11] *= -1
    viewdirs /= np.linalg.norm(viewdirs, axis=1, keepdims=True)
    return origins.astype(np.float32), viewdirs.astype(np.float32)


@pytest.mark.parametrize("step", [1.0, 0.75, 0.6, 0.31])
@pytest.mark.parametrize(("shape", "share"), [((9, 6, 11), 0.15), ((13, 13, 13), 0.03), ((4, 5, 3), 0.6)])
def test_marching_samples_exactly_the_steps_in_occupied_cells(shape, share, step):
    random = np.random.default_rng(len(shape) + int(100 * step) + shape[0])
    occupied = random.random(shape) < share
    occupied[-1, -1, -1] = True
    origins, viewdirs = random_rays(random, shape)
    jitter = random.random(N_RAYS).astype(np.float32)
    corners = torch.tensor(MINIMUM).float(), torch.tensor(MINIMUM + VOXEL * np.array(shape)).float()
    paths = clipped_paths(torch.from_numpy(origins), torch.from_numpy(viewdirs), *corners)
    samples = march(paths, torch.from_numpy(occupied), step, corners[0], VOXEL, torch.from_numpy(jitter))
    ray_indices = samples.ray_indices.numpy()
    entry = np.linalg.norm(paths[:, 0].numpy() - origins, axis=1)
    distances = samples.distances.numpy() + entry[ray_indices]
    n_found = 0
    for ray in range(N_RAYS):
        expected, inside, clearance = march_one(
            origins[ray].astype(float), viewdirs[ray].astype(float), MINIMUM, VOXEL, occupied, step * VOXEL, jitter[ray]
        )
        found = distances[ray_indices == ray]
        n_found += len(found)
        assert (np.diff(found) > 0).all()
        # within rounding of a cell's face both results are right
        required, allowed = expected[inside & (clearance > 1e-4)], expected[inside | (clearance <= 1e-4)]
        assert all(np.abs(found - distance).min(initial=np.inf) < 1e-5 for distance in required)
        assert all(np.abs(allowed - distance).min(initial=np.inf) < 1e-5 for distance in found)
    assert n_found == len(samples) > 20
    assert (np.diff(ray_indices) >= 0).all()
    assert samples.step == pytest.approx(step * VOXEL)
    assert_allclose(samples.positions, origins[ray_indices] + distances[:, None] * viewdirs[ray_indices], atol=1e-5)


def test_samples_are_evenly_spaced_along_paths():
    bent = torch.tensor([[[-0.5, 0.5, 0.5], [1.75, 0.5, 0.5], [1.75, 3.5, 0.5], [1.75, 3.5, 9.0]]])
    samples = march(bent, FULL, 0.5)
    assert_allclose(samples.distances, np.arange(0.75, 8.75, 0.5))  # 0.5 before the grid; z = 4 after 8.75
    along, across = samples.positions[:4], samples.positions[4:10]
    assert_allclose(along[:, 0], samples.distances[:4] - 0.5)
    assert_allclose(across[:, 1], samples.distances[4:10] - 1.75)
    assert_allclose(across[:, 0], 1.75)
    straight = torch.tensor([[[0.0, 2.0, 2.0], [4.0, 2.0, 2.0]]])
    assert_allclose(march(straight, FULL, 1.0).distances, [0.5, 1.5, 2.5, 3.5])


@pytest.mark.parametrize("n_knots", [2, 3, 9])
def test_nearest_place_on_a_path_matches_brute_force(n_knots):
    random = torch.Generator().manual_seed(n_knots)
    lines = sampling.Polylines(torch.rand(40, n_knots, 3, generator=random))
    points = torch.rand(40, 3, generator=random)

    def gaps(distances):
        return torch.linalg.norm(lines.points(torch.arange(40), distances) - points[:, None], dim=2)

    distance, gap = lines.nearest(points)
    assert_allclose(gap, gaps(torch.linspace(0, 1, 4001) * lines.lengths[:, None]).amin(1), atol=1e-3)
    assert_allclose(gaps(distance[:, None])[:, 0], gap, atol=1e-5)


def test_rays_are_clipped_to_the_box():
    origins = torch.tensor([[0.5, 0.5, 0.5], [0.5, 0.5, 3.0], [0.5, 0.5, -2.0], [5.0, 0.5, 0.5]])
    viewdirs = torch.tensor([[0.0, 0.0, 1.0]] * 3 + [[0.0, 1.0, 0.0]])
    first, last = clipped_paths(origins, viewdirs, ORIGIN, torch.ones(3)).unbind(1)
    assert_allclose(first[[0, 2]], [[0.5, 0.5, 0.5], [0.5, 0.5, 0]])
    assert_allclose(last[[0, 2]], [[0.5, 0.5, 1]] * 2)
    assert_allclose((last - first)[[1, 3]], 0)


@pytest.mark.parametrize("occupied", [~FULL, FULL])
def test_marching_beside_the_grid_or_without_rays_gives_no_samples(occupied):
    for paths in (torch.full((1, 2, 3), 9.0), torch.zeros(0, 2, 3)):
        samples = march(paths, occupied, 0.5)
        assert len(samples) == 0 and samples.positions.shape == (0, 3)


def test_outside_positions_map_to_the_nearest_border_cell():
    positions = torch.tensor([[-9.0, 0.5, 0.5], [1.5, 2.5, 3.5], [9.0, 9.0, 9.0]])
    assert sampling.cell_indices(positions, ORIGIN, 1.0, (2, 3, 4)).tolist() == [0, 12 + 2 * 4 + 3, 23]


def uniform(*shape, seed=0):
    return torch.rand(*shape, generator=torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("in_disparity", [False, True])
def test_coarse_samples_are_stratified(in_disparity):
    even = sampling.stratified_samples(2, 6, 16, in_disparity, torch.zeros(1, 0))[0]
    expected = 1 / np.linspace(1 / 2, 1 / 6, 16) if in_disparity else np.linspace(2, 6, 16)
    assert_allclose(even, expected, rtol=1e-6)
    t = sampling.stratified_samples(2, 6, 16, in_disparity, uniform(4000, 16))
    assert t.shape == (4000, 16) and t.min() >= 2 and t.max() <= 6
    middles = (even[1:] + even[:-1]) / 2
    assert (t[:, :-1] <= middles).all() and (t[:, 1:] >= middles).all()
    assert_allclose(t[:, 1:-1].mean(0), (middles[1:] + middles[:-1]) / 2, atol=0.02)


def test_inverse_distribution_function_matches_numpy():
    edges, weights, u = uniform(7, 20).sort(1).values, uniform(7, 19, seed=1), uniform(7, 33, seed=2)
    weights[0] = 0  # an empty ray is sampled evenly
    weights[1, 3:9] = 0
    for row in range(7):
        density = weights[row].double().numpy() + 1e-5
        cdf = np.concatenate([[0], np.cumsum(density / density.sum())])
        expected = np.interp(u[row].numpy(), cdf, edges[row].numpy())
        assert_allclose(sampling.sample_pdf(edges, weights, u)[row], expected, atol=1e-4)


def test_fine_samples_concentrate_where_weights_are():
    t = sampling.stratified_samples(2, 6, 32, False, torch.zeros(3, 0))
    weights = torch.zeros(3, 32)
    weights[:, 20] = 1
    union = sampling.refine(t, weights, torch.linspace(0, 1, 64).expand(3, -1))
    assert union.shape == (3, 96) and (union.diff(dim=1) >= 0).all()
    assert all(torch.isin(t[row], union[row]).all() for row in range(3))
    assert (((union - t[:, 20:21]).abs() < 0.13).sum(1) > 60).all()


def test_dense_and_packed_weights_agree():
    sigmas, t = 3 * uniform(5, 12), uniform(5, 12, seed=1).sort(1).values
    deltas = sampling.interval_lengths(t)
    assert (deltas[:, -1] == 1e10).all()
    weights = sampling.dense_ray_weights(sigmas, deltas)
    rays = torch.arange(5).repeat_interleave(12)
    assert_allclose(weights.view(-1), ray_weights_from_sigmas(sigmas.view(-1), deltas.view(-1), rays), atol=1e-6)
    assert_allclose(weights.sum(1), np.ones(5), atol=1e-6)


def test_gradients_stay_finite_behind_opaque_samples():
    sigmas = torch.tensor([[0.0, 50.0, 1e6, 2.0]], requires_grad=True)
    deltas = sampling.interval_lengths(torch.tensor([[1.0, 2.0, 3.0, 4.0]]))
    sampling.dense_ray_weights(sigmas, deltas)[0, 1].backward()
    assert torch.isfinite(sigmas.grad).all()
