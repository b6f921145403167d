"""Spaces: world and grid coordinates lead to each other, and a ray's path in the grid is what its points map to."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

torch = pytest.importorskip("torch")

from karf_engine.fields.rendering.rays import Rays
from karf_engine.fields.rendering.sampling import Polylines
from karf_engine.fields.rendering.space import Box, Contraction, Frustum, Similarity, space_from_json, space_to_json

CENTER = torch.tensor([0.5, -1.0, 2.0])


def contraction(room=1.0):
    return Contraction(CENTER, radius=1.5, room=room, near=0.05)


def frustum():
    """Looks along +y from (1, 2, 3); z is up."""
    pose = torch.eye(4)
    pose[:3, :3] = torch.tensor([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    pose[:3, 3] = torch.tensor([1.0, 2.0, 3.0])
    return Frustum(torch.linalg.inv(pose), torch.tensor([2.4, 2.2]), near=0.8, depth_scale=0.5)


def similarity():
    """Turned by a right angle round z, 2.5 times as large, moved."""
    matrix = torch.eye(4)
    matrix[:3, :3] = 2.5 * torch.tensor([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    matrix[:3, 3] = torch.tensor([1.0, 0.0, -3.0])
    return Similarity(matrix)


def random_points(n, spread, seed=0):
    return spread * torch.randn(n, 3, generator=torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("room", [0.4, 1.0, 2.0])
def test_a_contraction_keeps_its_ball_and_brings_all_else_within_reach(room):
    space = contraction(room)
    near = CENTER + 1.5 * torch.nn.functional.normalize(random_points(50, 1)) * torch.rand(50, 1)
    assert_allclose(space.to_grid(near), (near - CENTER) / 1.5, atol=1e-6)
    far = CENTER + random_points(500, 1000.0)
    norms = torch.linalg.norm(space.to_grid(far), dim=1)
    assert (norms > 1).all() and (norms < 1 + room).all()
    one_and_a_half_out = space.to_grid(CENTER + torch.tensor([[0.0, 3.0, 0.0]]))  # y = 2: 1 + b - b / 2
    assert_allclose(one_and_a_half_out, [[0, 1 + room / 2, 0]], atol=1e-6)


@pytest.mark.parametrize("space", [Box(), similarity(), contraction(), contraction(0.5), frustum()], ids=str)
def test_grid_coordinates_lead_back_to_the_world(space):
    points = random_points(300, 2.5) + torch.tensor([1.0, 14.0, 3.0])
    assert_allclose(space.to_world(space.to_grid(points)), points, rtol=2e-4, atol=2e-3)


def test_a_frustum_has_its_near_plane_in_front_and_infinity_at_the_back():
    space = frustum()
    on_axis = torch.tensor([[1.0, 2.8, 3.0], [1.0, 1e7, 3.0]])
    assert_allclose(space.to_grid(on_axis), [[0, 0, -0.5], [0, 0, 0.5]], atol=1e-5)
    beside = torch.tensor([[1.0 + 1 / 2.4, 3.0, 3.0], [1.0, 3.0, 3.0 + 1 / 2.2]])  # at depth one
    assert_allclose(space.to_grid(beside)[:, :2], [[1, 0], [0, 1]], atol=1e-5)


@pytest.mark.parametrize("space", [contraction(), frustum()], ids=str)
def test_a_path_is_where_the_points_of_its_ray_map_to(space):
    viewdirs = torch.nn.functional.normalize(torch.tensor([0.0, 1.0, 0.0]) + random_points(60, 0.2), dim=1)
    rays = Rays(torch.tensor([1.0, 2.0, 3.0]) + random_points(60, 0.1, 1), viewdirs)
    lines = Polylines(space.paths(rays, torch.full((3,), -9.0), torch.full((3,), 9.0)))
    for distance in (1.5, 4.0, 20.0, 300.0):
        _, gap = lines.nearest(space.to_grid(rays.origins + distance * viewdirs))
        assert gap.max() < 4e-3


def test_the_knots_of_a_contracted_path_are_close_together():
    viewdirs = torch.nn.functional.normalize(random_points(80, 1.0), dim=1)
    rays = Rays(CENTER + random_points(80, 2.0, 1), viewdirs)
    paths = contraction().paths(rays, torch.full((3,), -2.0), torch.full((3,), 2.0))
    assert torch.linalg.norm(paths[:, 1:] - paths[:, :-1], dim=2).max() < 0.12


def test_a_ray_that_looks_back_has_no_path_in_a_frustum():
    rays = Rays(torch.tensor([[1.0, 2.0, 3.0]]), torch.tensor([[0.0, -1.0, 0.0]]))
    assert Polylines(frustum().paths(rays, torch.full((3,), -1.0), torch.full((3,), 1.0))).lengths.item() == 0


@pytest.mark.parametrize("space", [Box(), contraction(), frustum()], ids=str)
def test_a_space_comes_back_from_plain_values(space):
    back = space_from_json(json.loads(json.dumps(space_to_json(space))))
    assert type(back) is type(space)
    points = random_points(20, 3.0)
    assert np.array_equal(back.to_grid(points), space.to_grid(points))


@pytest.mark.parametrize("space", [Box(), similarity(), frustum()], ids=str)
def test_lines_are_the_grid_coordinates_of_a_rays_points(space):
    rays = Rays(torch.tensor([[1.2, 1.9, 3.1]]).repeat(40, 1), random_points(40, 0.3) + torch.tensor([0.0, 1.0, 0.0]))
    rays = Rays(rays.origins, torch.nn.functional.normalize(rays.viewdirs, dim=1))
    origins, directions = space.to_grid_rays(rays)
    at = space.to_grid(rays.origins + 4.0 * rays.viewdirs) - origins
    assert_allclose(torch.linalg.cross(at, directions), np.zeros((40, 3)), atol=2e-4)
    if not isinstance(space, Frustum):  # there t is the distance
        assert_allclose(at, 4 * directions, atol=1e-5)
        step = space.to_grid(rays.origins + rays.viewdirs) - space.to_grid(rays.origins)
        assert_allclose(space.rotate_directions(rays.viewdirs), torch.nn.functional.normalize(step, dim=1), atol=1e-5)
