"""The voxel field interpolates, refines and prunes as scipy and formulas by hand do."""

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose
from scipy import ndimage

from karf_engine.fields.voxels.field import VoxelField, WeightedGather, rescaled_raw

MINIMUM, VOXEL = torch.tensor([-1.0, 0.5, 2.0]), 0.25


def random_field(occupied, seed=0, n_features=5):
    torch.manual_seed(seed)
    field = VoxelField(MINIMUM, VOXEL, occupied, n_features, width=8)
    field.raw_density.data.normal_(0, 3)
    field.feature_table.data.normal_()
    field.color_network[2].weight.data.normal_()
    return field.requires_grad_(False)


def random_points(shape, count, seed=1):
    random = torch.Generator().manual_seed(seed)
    return MINIMUM + torch.rand(count, 3, generator=random) * VOXEL * torch.tensor(shape)


def random_occupancy(shape, share, seed=2):
    return torch.rand(shape, generator=torch.Generator().manual_seed(seed)) < share


def test_interpolation_on_a_full_grid_matches_scipy():
    shape = (4, 6, 3)
    field = random_field(torch.ones(shape, dtype=torch.bool))
    points = random_points(shape, 500)
    index = ((points - MINIMUM) / VOXEL).numpy().T
    vertices = tuple(n + 1 for n in shape)
    for column in range(5):
        grid = field.feature_table[:, column].view(vertices).numpy()
        assert_allclose(field.features(points)[:, column], ndimage.map_coordinates(grid, index, order=1), atol=1e-5)
    raw = ndimage.map_coordinates(field.raw_density.view(vertices).numpy(), index, order=1).astype(float)
    assert_allclose(field.density(points), np.logaddexp(0, raw - 5.5) / VOXEL, rtol=1e-4, atol=1e-6)


def test_density_is_zero_outside_occupied_cells_and_the_box():
    occupied, points = random_occupancy((5, 4, 6), 0.4), random_points((5, 4, 6), 400)
    field = random_field(occupied)
    inside = occupied[tuple(((points - MINIMUM) / VOXEL).long().T)]
    density = field.density(points)
    assert (density[inside] > 0).all() and (density[~inside] == 0).all()
    assert 50 < int(inside.sum()) < 350
    outside_box = MINIMUM + VOXEL * torch.tensor([[-0.5, 1, 1], [1, 1, 6.5], [1, 99, 1]])
    assert field.density(outside_box).tolist() == [0, 0, 0]


def test_weighted_gather_matches_its_formula_and_gradient():
    random = torch.Generator().manual_seed(3)
    rows = torch.randint(6, (7, 8), generator=random)
    weights = torch.rand(7, 8, generator=random, dtype=torch.float64)
    for width in (1, 3):
        table = torch.randn(6, width, generator=random, dtype=torch.float64, requires_grad=True)
        expected = (weights[..., None] * table[rows]).sum(1)
        assert_allclose(WeightedGather.apply(table, rows, weights).detach(), expected.detach(), atol=1e-12)
        assert torch.autograd.gradcheck(lambda t: WeightedGather.apply(t, rows, weights), table)


def test_doubling_resolution_keeps_density_at_old_vertices():
    field = random_field(torch.ones(6, 4, 5, dtype=torch.bool))
    fine = field.refined(12).requires_grad_(False)
    assert fine.occupied.shape == (12, 8, 10) and fine.occupied.all()
    assert fine.voxel == pytest.approx(VOXEL / 2)
    vertices, points = MINIMUM + VOXEL * torch.nonzero(torch.ones(6, 4, 5)), random_points((6, 4, 5), 300)
    assert (field.density(vertices) > 0).all() and (fine.density(vertices) > 0).all()
    assert_allclose(fine.density(vertices), field.density(vertices), rtol=2e-3, atol=1e-6)
    assert_allclose(fine.features(points), field.features(points), atol=1e-4)


def test_refining_keeps_the_density_of_even_fog():
    field = random_field(random_occupancy((7, 7, 7), 0.5))
    field.raw_density.data.fill_(4.0)
    fine = field.refined(19).requires_grad_(False)
    points = random_points((7, 7, 7), 2000)
    points = points[field.is_occupied(points) & fine.is_occupied(points)]
    assert len(points) > 300
    assert_allclose(fine.density(points), field.density(points), rtol=1e-4)


@pytest.mark.parametrize("raw", [-60.0, -8.0, 0.0, 7.0, 200.0])
def test_rescaled_raw_density_scales_extreme_densities(raw):
    raw, ratio, bias = torch.tensor(raw, dtype=torch.float64), 0.37, -5.5
    softplus = torch.nn.functional.softplus
    assert_allclose(softplus(rescaled_raw(raw, ratio, bias) + bias), ratio * softplus(raw + bias), rtol=1e-9)


def test_refined_grid_fits_tightly_around_occupied_cells():
    occupied = torch.zeros(16, 16, 16, dtype=torch.bool)
    occupied[4:7, 9:11, 2] = True
    field, points = random_field(occupied), random_points((16, 16, 16), 4000)
    fine = field.refined(20)
    assert torch.equal(fine.is_occupied(points), field.is_occupied(points))
    assert max(fine.occupied.shape) == 20
    corners = torch.tensor([[3.0, 8.0, 1.0], [8.0, 12.0, 4.0]])
    assert_allclose(fine.bounds, MINIMUM + VOXEL * corners, atol=1e-5)


def test_pruning_keeps_chosen_cells_their_neighbors_and_values():
    field = random_field(random_occupancy((8, 8, 8), 0.7))
    keep = torch.rand(int(field.occupied.sum()), generator=torch.Generator().manual_seed(5)) < 0.05
    small = field.pruned(keep).requires_grad_(False)
    chosen = torch.zeros_like(field.occupied)
    chosen[field.occupied] = keep
    neighborhood = torch.from_numpy(ndimage.maximum_filter(chosen.numpy(), 3))
    assert torch.equal(small.occupied, neighborhood & field.occupied)
    assert chosen.sum() < small.occupied.sum() < field.occupied.sum()
    points = random_points((8, 8, 8), 2000)
    points = points[small.is_occupied(points)]
    viewdirs, features = torch.nn.functional.normalize(points, dim=1), field.features(points)
    assert torch.equal(small.density(points), field.density(points))
    assert torch.equal(small.features(points), features)
    assert torch.equal(small.color(points, viewdirs, features), field.color(points, viewdirs, features))


def test_normals_point_out_of_a_ball():
    grid = torch.stack(torch.meshgrid(*[torch.arange(17.0)] * 3, indexing="ij"), -1) - 8
    field = VoxelField(MINIMUM, VOXEL, torch.ones(16, 16, 16, dtype=torch.bool))
    field.raw_density.data = (4.0 * (5 - grid.norm(dim=-1))).view(-1, 1)
    directions = torch.nn.functional.normalize(torch.randn(100, 3, generator=torch.Generator().manual_seed(0)), dim=1)
    normals = field.normals(MINIMUM + VOXEL * (8 + 5 * directions))
    assert ((normals * directions).sum(1) > 0.9).all()
