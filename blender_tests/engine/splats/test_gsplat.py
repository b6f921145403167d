"""gsplat renders the pictures, gradients and training steps of the kernels.

On the processor its CUDA kernels are replaced by its own pure-torch reference, and the last of them, which has none that
runs there, by what its CUDA source says; with `--device cuda` they run themselves.
"""

from dataclasses import replace

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose, assert_array_equal

pytest.importorskip("numba")
pytest.importorskip("gsplat")

from gsplat.cuda import _torch_impl as reference

from blender_tests.engine.splats.clouds import BACKGROUND, GROUPS, NEAR, ball, camera_ahead, cloud
from karf_engine.splats import gsplat_view
from karf_engine.splats.compiled import CompiledTable, CompiledView
from karf_engine.splats.gaussians import Gaussians
from karf_engine.splats.gsplat_view import GsplatTable, GsplatView
from karf_engine.splats.kernels.arrays import ANTIALIASED_FILTER, BORDER, LOGIT, PIXEL_FILTER, PLAIN_FILTER
from karf_engine.splats.rasterizer import pinhole


def project(means, covariances, quaternions, scales, *camera, **options):
    covariances, _ = reference._quat_scale_to_covar_preci(quaternions, scales, compute_preci=False)
    return reference._fully_fused_projection(means, covariances, *camera, **options)


def composite(means, conics, values, opacities, width, height, side, starts, order, backgrounds=None):
    """RasterizeToPixels3DGSFwd.cu, for one picture."""
    ends = [*starts.flatten()[1:].tolist(), len(order)]
    rows = []
    for top, first_of_row in enumerate(starts[0].tolist()):
        tiles = []
        for left, first in enumerate(first_of_row):
            ids = order[first : ends[top * starts.shape[2] + left]].long()
            v, u = torch.meshgrid(torch.arange(side) + top * side, torch.arange(side) + left * side, indexing="ij")
            dx, dy = (means[0, ids] - 0.5 - torch.stack([u, v], -1)[:, :, None]).unbind(-1)
            a, b, c = conics[0, ids].unbind(-1)
            alphas = (opacities[0, ids] * (-0.5 * (a * dx * dx + c * dy * dy) - b * dx * dy).exp()).clamp_max(0.999)
            alphas = alphas * (alphas >= 1 / 255)
            alphas = alphas * ((1 - alphas).cumprod(-1) > 1e-4)
            after = torch.cat([torch.ones(side, side, 1), (1 - alphas).cumprod(-1)], -1)
            tiles.append(torch.cat([(alphas * after[..., :-1]) @ values[0, ids], 1 - after[..., -1:]], -1))
        rows.append(torch.cat(tiles, 1))
    image = torch.cat(rows)[None, :height, :width]
    behind = 0 if backgrounds is None else (1 - image[..., -1:]) * backgrounds
    return image[..., :-1] + behind, image[..., -1:]


@pytest.fixture(autouse=True)
def kernels(device, monkeypatch):
    """The CUDA kernels on a card, the reference elsewhere."""
    if device.type == "cuda":
        return
    monkeypatch.setattr(gsplat_view, "fully_fused_projection", project)
    monkeypatch.setattr(gsplat_view, "spherical_harmonics", reference._spherical_harmonics)
    monkeypatch.setattr(gsplat_view, "isect_tiles", reference._isect_tiles)
    monkeypatch.setattr(gsplat_view, "isect_offset_encode", reference._isect_offset_encode)
    monkeypatch.setattr(gsplat_view, "rasterize_to_pixels", composite)


FILTERS = {"own": PIXEL_FILTER, "plain": PLAIN_FILTER, "antialiased": ANTIALIASED_FILTER}
BESIDE = 4 * (20 + 0.9 * BORDER * 40) / 50  # a center almost as far from the picture as any that is shown
CASES = {f"{name}, {degree}": (cloud(degree=degree), FILTERS[name]) for name in FILTERS for degree in range(4)}
CASES |= {"solid": (cloud(30, 0, seed=3), PIXEL_FILTER), "beside": (ball((BESIDE, 0.1, 0), 0.6)[None], PIXEL_FILTER)}
CASES["solid"][0][:, LOGIT] = 3.0
CASES["out of sight"] = (
    np.stack([ball(), *(ball(at, 0.02) for at in ((0, 0, 3.9), (0, 0, 9), (9, 0, 0)))]),
    PIXEL_FILTER,
)


@pytest.mark.on_device("gsplat's kernels, against numba's")
@pytest.mark.parametrize("case", CASES)
def test_pictures_and_gradients_match_the_kernels(case, device):
    table, screen_filter = CASES[case]
    camera = pinhole(camera_ahead(), NEAR, screen_filter)
    own, variable = CompiledView(table, camera, BACKGROUND), torch.tensor(table, device=device, requires_grad=True)
    other = GsplatView(variable, camera, BACKGROUND)
    assert_allclose(other.image, own.image, atol=1e-4)
    assert_array_equal(other.is_seen, own.is_seen)
    assert_allclose(other.depths[own.is_seen], own.depths[own.is_seen], rtol=1e-5)
    assert_allclose(other.colors, own.colors, atol=1e-5)
    assert_allclose(other.blended(table[:, :5]), own.blended(table[:, :5]), atol=1e-4 * abs(table[:, :5]).max())
    assert_allclose(other.weights(), own.weights(), rtol=1e-4, atol=1e-3)
    weights = np.random.default_rng(1).normal(size=own.image[..., :3].shape).astype(np.float32)
    by_kernels = np.zeros_like(table)
    own.backward(weights, by_kernels)
    (by_gsplat,) = torch.autograd.grad(other.rendered, variable, torch.from_numpy(weights).to(device)[None])
    for name, columns in GROUPS.items():
        expected = by_kernels[:, columns]
        largest = max(abs(expected).max(initial=0), 1e-3 * abs(by_kernels).max())
        assert_allclose(by_gsplat.cpu().numpy()[:, columns], expected, atol=1e-4 * largest, err_msg=name)


@pytest.mark.on_device("gsplat's kernels, against numba's")
def test_faded_colors_match_the_kernels(device):
    table, camera = cloud(), pinhole(camera_ahead(), NEAR)
    sure = np.random.default_rng(2).random(len(table)).astype(np.float32)
    shown = GsplatView(torch.from_numpy(table).to(device), camera, BACKGROUND, sure)
    expected = CompiledView(table, camera, BACKGROUND, sure)
    assert_allclose(shown.image, expected.image, atol=1e-4)
    assert_allclose(shown.colors, expected.colors, atol=1e-5)


@pytest.mark.on_device("gsplat's kernels, against numba's")
def test_training_steps_match_the_kernels(device):
    start = Gaussians(cloud(40, 1, seed=7), 5, BACKGROUND, NEAR)
    start = replace(start, table=np.concatenate([ball((0, 0, 9), degree=1)[None], start.table]))  # never seen
    least = np.full(len(start), -3.5, np.float32)
    rates = np.full(start.table.shape[1], 0.01, np.float32)
    camera = pinhole(camera_ahead(), NEAR)
    tables = CompiledTable(start, least), GsplatTable(start, least, device)
    for number in range(3):
        gradient = np.random.default_rng(number).normal(size=(36, 40, 3)).astype(np.float32)
        for table in tables:
            table.update(table.view(camera, BACKGROUND), gradient, rates)
    expected, found = (table.tensors() for table in tables)
    for name in expected:
        assert found[name].dtype == expected[name].dtype
        largest = abs(expected[name]).max()
        assert_allclose(found[name].cpu(), expected[name], atol=2e-4 * float(largest), err_msg=name)
    assert all(table.is_finite() for table in tables)
    found["table"][0, 0] = torch.nan  # what is resumed is written there
    assert not tables[1].is_finite()
