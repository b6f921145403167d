"""Marching: the samples are exactly those that a loop over all equal steps finds in occupied cells."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

torch = pytest.importorskip("torch")

from blender_tests.engine.reference.rays import march_one
from karf_engine.fields.rendering.sampling import Polylines, cell_indices, coarse_occupancy, march
from karf_engine.fields.rendering.space import clipped_paths

MINIMUM, VOXEL = np.array([-1.0, 0.5, -0.3]), 0.17
N_RAYS = 300


def rays_through(random, shape, n_rays):
    """Rays from all around to random points of the box; some start inside, some run along an axis, some miss."""
    size = VOXEL * np.array(shape)
    targets = MINIMUM + random.uniform(0.02, 0.98, (n_rays, 3)) * size
    origins = MINIMUM + size / 2 + random.normal(size=(n_rays, 3)) * size
    viewdirs = targets - origins
    axis_parallel = np.arange(n_rays) % 4 == 0
    axes = np.eye(3)[random.integers(0, 3, n_rays)] * random.choice([-1.0, 1.0], (n_rays, 1))
    viewdirs[axis_parallel] = axes[axis_parallel]
    inside = np.arange(n_rays) % 5 == 0
    origins[inside] = targets[inside]
    away = np.arange(n_rays) % 11 == 7
    viewdirs[away] *= -1
    viewdirs /= np.linalg.norm(viewdirs, axis=1, keepdims=True)
    return origins.astype(np.float32), viewdirs.astype(np.float32)


@pytest.mark.parametrize("step", [1.0, 0.75, 0.6, 0.31])
@pytest.mark.parametrize(("shape", "share"), [((9, 6, 11), 0.15), ((13, 13, 13), 0.03), ((4, 5, 3), 0.6)])
def test_marched_samples_are_exactly_the_steps_inside_occupied_cells(shape, share, step):
    random = np.random.default_rng(len(shape) + int(100 * step) + shape[0])
    occupied = random.random(shape) < share
    occupied[tuple(np.array(shape) - 1)] = True
    origins, viewdirs = rays_through(random, shape, N_RAYS)
    jitter = random.random(N_RAYS).astype(np.float32)
    grid = torch.from_numpy(occupied)
    minimum = torch.from_numpy(MINIMUM).float()
    paths = clipped_paths(
        torch.from_numpy(origins), torch.from_numpy(viewdirs), minimum, minimum + VOXEL * torch.tensor(shape)
    )
    samples = march(paths, minimum, VOXEL, grid, coarse_occupancy(grid), step, torch.from_numpy(jitter))
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
        # within rounding of a cell's face either side is right
        required, allowed = expected[inside & (clearance > 1e-4)], expected[inside | (clearance <= 1e-4)]
        assert all(np.abs(found - distance).min(initial=np.inf) < 1e-5 for distance in required)
        assert all(np.abs(allowed - distance).min(initial=np.inf) < 1e-5 for distance in found)
    assert n_found == len(samples) > 20
    assert (np.diff(ray_indices) >= 0).all()
    assert samples.step == pytest.approx(step * VOXEL)
    assert_allclose(samples.positions, origins[ray_indices] + distances[:, None] * viewdirs[ray_indices], atol=1e-5)


def test_samples_of_a_bent_path_are_equally_far_apart_along_it_and_stay_in_the_grid():
    path = torch.tensor([[[-0.5, 0.5, 0.5], [1.75, 0.5, 0.5], [1.75, 3.5, 0.5], [1.75, 3.5, 9.0]]])
    occupied = torch.ones(4, 4, 4, dtype=torch.bool)
    samples = march(path, torch.zeros(3), 1.0, occupied, coarse_occupancy(occupied), 0.5)
    assert_allclose(samples.distances, np.arange(0.75, 8.75, 0.5))  # 0.5 before the grid; z = 4 after 8.75
    corner = 2.25
    along, across = samples.positions[:4], samples.positions[4:10]
    assert_allclose(along[:, 0], samples.distances[:4] - 0.5)
    assert_allclose(across[:, 1], samples.distances[4:10] - corner + 0.5)
    assert_allclose(across[:, 0], 1.75)


@pytest.mark.parametrize("n_knots", [2, 3, 9])
def test_the_nearest_place_of_a_path_is_the_nearest_of_many_tried(n_knots):
    random = torch.Generator().manual_seed(n_knots)
    paths = torch.rand(40, n_knots, 3, generator=random)
    points = torch.rand(40, 3, generator=random)
    lines = Polylines(paths)
    at, gap = lines.nearest(points)
    tried = torch.linspace(0, 1, 4001) * lines.lengths[:, None]
    gaps = torch.linalg.norm(lines.points(torch.arange(40), tried) - points[:, None], dim=2)
    assert_allclose(gap, gaps.amin(1), atol=1e-3)
    assert_allclose(
        torch.linalg.norm(lines.points(torch.arange(40), at[:, None])[:, 0] - points, dim=1), gap, atol=1e-5
    )


def test_without_jitter_samples_lie_in_the_middle_of_their_steps():
    occupied = torch.ones(4, 4, 4, dtype=torch.bool)
    path = torch.tensor([[[0.0, 2.0, 2.0], [4.0, 2.0, 2.0]]])
    samples = march(path, torch.zeros(3), 1.0, occupied, coarse_occupancy(occupied), 1.0)
    assert_allclose(samples.distances, [0.5, 1.5, 2.5, 3.5])


def test_a_ray_inside_the_box_starts_at_its_origin_and_one_that_misses_has_nothing():
    origins = torch.tensor([[0.5, 0.5, 0.5], [0.5, 0.5, 3.0], [0.5, 0.5, -2.0], [5.0, 0.5, 0.5]])
    viewdirs = torch.tensor([[0.0, 0.0, 1.0]] * 3 + [[0.0, 1.0, 0.0]])
    first, last = clipped_paths(origins, viewdirs, torch.zeros(3), torch.ones(3)).unbind(1)
    assert_allclose(first[[0, 2]], [[0.5, 0.5, 0.5], [0.5, 0.5, 0]])
    assert_allclose(last[[0, 2]], [[0.5, 0.5, 1]] * 2)
    assert_allclose((last - first)[[1, 3]], 0)


@pytest.mark.parametrize("occupied", [torch.zeros(5, 5, 5, dtype=torch.bool), torch.ones(5, 5, 5, dtype=torch.bool)])
def test_nothing_to_march_gives_no_samples(occupied):
    paths = torch.full((1, 2, 3), 9.0)
    for some in (paths, paths[:0]):
        samples = march(some, torch.zeros(3), 1.0, occupied, coarse_occupancy(occupied), 0.5)
        assert len(samples) == 0 and samples.positions.shape == (0, 3)


def test_positions_outside_take_the_nearest_border_cell():
    positions = torch.tensor([[-9.0, 0.5, 0.5], [1.5, 2.5, 3.5], [9.0, 9.0, 9.0]])
    assert cell_indices(positions, torch.zeros(3), 1.0, (2, 3, 4)).tolist() == [0, 12 + 2 * 4 + 3, 23]
