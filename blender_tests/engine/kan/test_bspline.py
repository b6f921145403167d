"""The B-spline layer: properties of the basis known from theory, values from tables, size."""

import pytest
import torch

from karf_engine.kan.layers import BSplineLayer, bspline_bases

GRID, ORDER = 5, 3
INTERVAL = 4 / GRID


def bases_at(points, order=ORDER):
    return bspline_bases(torch.tensor(points, dtype=torch.float64)[:, None], GRID, order)[:, :, 0]


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_bases_sum_to_one_inside_the_range(order):
    sums = bases_at(torch.linspace(-2, 1.999, 101).tolist(), order).sum(dim=1)
    torch.testing.assert_close(sums, torch.ones_like(sums))


def test_bases_are_not_negative_and_at_most_four_act_at_once():
    bases = bases_at(torch.linspace(-3, 3, 301).tolist())
    assert bases.min() >= 0
    assert (bases > 0).sum(dim=1).max() == ORDER + 1


def test_each_basis_vanishes_outside_its_four_intervals():
    points = torch.linspace(-6, 6, 601, dtype=torch.float64)
    bases = bases_at(points.tolist())
    for index in range(GRID + ORDER):
        start = -2 + (index - ORDER) * INTERVAL
        outside = (points < start - 1e-9) | (points > start + (ORDER + 1) * INTERVAL + 1e-9)
        assert bases[outside, index].max() == 0
        assert bases[~outside, index].max() > 0.6


@pytest.mark.parametrize(
    ("place", "expected"), [(1, [0, 1 / 6, 4 / 6, 1 / 6, 0]), (1.5, [0, 1 / 48, 23 / 48, 23 / 48, 1 / 48])]
)
def test_cubic_at_a_knot_and_in_the_middle_of_an_interval_has_the_tabulated_values(place, expected):
    bases = bases_at([-2 + place * INTERVAL])[0]
    torch.testing.assert_close(bases[:5], torch.tensor(expected, dtype=torch.float64))
    assert not bases[5:].any()


def test_layer_equals_base_plus_scaled_splines():
    layer = BSplineLayer(3, 2)
    torch.nn.init.uniform_(layer.spline_scale)
    x = torch.randn(4, 3)
    bases = bspline_bases(layer.norm(x), GRID, ORDER)
    splines = torch.einsum("nki,oki,oi->no", bases, layer.spline_weight, layer.spline_scale[:, 0])
    torch.testing.assert_close(layer(x), layer.base(torch.nn.functional.silu(x)) + splines)


def test_without_layer_norm_only_the_base_acts_outside_the_range():
    layer = BSplineLayer(3, 2, layer_norm=False)
    x = torch.full((1, 3), 5.0)
    torch.testing.assert_close(layer(x), layer.base(torch.nn.functional.silu(x)))


@pytest.mark.parametrize("layer_norm, expected", [(False, 816_640), (True, 816_640 + 2 * 319)])
def test_layer_has_the_published_number_of_parameters(layer_norm, expected):
    layer = BSplineLayer(319, 256, layer_norm=layer_norm)
    assert sum(parameter.numel() for parameter in layer.parameters()) == expected


def test_gradients_match_finite_differences():
    layer = BSplineLayer(3, 2).double()
    x = torch.randn(4, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(1), requires_grad=True)
    assert torch.autograd.gradcheck(layer, x)
