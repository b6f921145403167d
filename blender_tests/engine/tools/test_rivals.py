"""The recoloring rules of other methods, each on a tiny scene with a known answer."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from karf_engine.capture.camera import Camera
from karf_engine.fields.rendering.surface_cache import SurfaceCache
from tools.evaluate.rivals import recolornerf
from tools.evaluate.rivals.decomposition import Training, edited_palette, learn, recolored
from tools.evaluate.rivals.laenerf import LaeNerf
from tools.evaluate.rivals.palettenerf import PaletteNerf, sparsity
from tools.evaluate.rivals.points import ObjectPoints
from tools.evaluate.rivals.recolornerf import RecolorNerf
from tools.evaluate.rivals.transfers import channel_gains
from tools.evaluate.rivals.warping import Painted, carried_over

RED, BLUE = np.array([0.8, 0.1, 0.1], np.float32), np.array([0.1, 0.2, 0.7], np.float32)
PALETTE = np.array([[0, 0, 0], [0.8, 0.1, 0.1]], np.float32)
SHORT = Training(iterations=80, batch=128)


def red_object(count=400):
    """A red object that is darker to one side."""
    random = torch.Generator().manual_seed(0)
    positions = torch.rand(count, 3, generator=random)
    shade = 0.4 + 0.6 * positions[:, :1]
    viewdirs = torch.nn.functional.normalize(torch.randn(count, 3, generator=random), dim=1)
    return ObjectPoints(positions, viewdirs, torch.cat([shade, shade**2], 1), shade * torch.from_numpy(RED))


@pytest.mark.parametrize("rule", [PaletteNerf, RecolorNerf, LaeNerf])
def test_learned_rule_recolors_and_keeps_the_shading(rule):
    torch.manual_seed(0)
    points = red_object()
    layers, every = rule(points, PALETTE), torch.arange(len(points))
    before = float(layers.loss(every, 0.9).detach())
    learn(layers, len(points), SHORT, torch.Generator().manual_seed(0))
    assert float(layers.loss(every, 0.9)) < before / 2
    edited = torch.from_numpy(edited_palette(layers, points, RED, BLUE)).float()
    weights = layers.weights(points.positions, points.features, points.viewdirs)
    shown = points.colors + weights @ (edited - layers.palette)
    wanted = points.colors[:, :1] / 0.8 * torch.from_numpy(BLUE)
    assert float((shown - wanted).abs().mean()) < 0.08 < float((points.colors - wanted).abs().mean()) / 2


def test_edit_is_weighted_by_object_probability():
    """Two rays: the first has one sample, half of it the object; both samples of the second are another object's."""
    values, ones = torch.zeros(2, 2, 3), torch.ones(2)
    cache = SurfaceCache(values, torch.ones(2, 2), values[:, 0], ones, torch.arange(2))
    frame = SimpleNamespace(picture=SimpleNamespace(cache=cache), base=np.full((1, 2, 3), 0.2, np.float32))
    samples = SimpleNamespace(
        classes=torch.tensor([[0.5, 0.5], [0.0, 1.0]]),
        rays=torch.tensor([0, 1]),
        counts=torch.tensor([1, 2]),
        **dict.fromkeys(("positions", "features", "viewdirs"), torch.zeros(2, 3)),
    )
    rule = SimpleNamespace(palette=torch.zeros(1, 3), weights=lambda positions, *_: torch.ones(len(positions), 1))
    picture = recolored(frame, samples, {0: rule}, {0: np.array([[0.4, 0.0, 0.0]])})
    assert picture == pytest.approx(np.array([[[0.3, 0.2, 0.2], [0.2, 0.2, 0.2]]]))


def test_formulas_match_the_papers():
    weights = recolornerf.over_weights(torch.tensor([[0.5, 0.25], [0.3, 1.0]]))
    assert weights.numpy() == pytest.approx(np.array([[0.375, 0.375, 0.25], [0, 0, 1]]))
    assert float(sparsity(torch.tensor([[0.0, 1.0, 0.0]]))) == pytest.approx(0)
    assert float(sparsity(torch.full((1, 4), 0.25))) == pytest.approx(3)
    photo, pair = np.tile(RED.astype(float), (1, 2, 1)), (RED.astype(float), BLUE.astype(float))
    gained = channel_gains(photo, {"pot": np.array([[True, False]])}, {"pot": pair})
    assert gained[0] == pytest.approx(np.array([BLUE, RED]), abs=1e-6)


def camera_at(x):
    pose = np.eye(4)
    pose[0, 3] = x
    return Camera(8, 8, 8.0, 8.0, 4.0, 4.0, pose)


def wall(base):
    """A wall one unit ahead that is all one object."""
    depth, own = np.ones((8, 8), np.float32), np.ones((1, 8, 8), np.float32)
    return SimpleNamespace(base=base, depth=depth, probabilities=own, masks=own > 0.5)


def test_change_is_carried_by_surface_and_else_by_color():
    base = np.full((8, 8, 3), 0.3)
    base[:, 4:] = 0.6
    change = np.where(base > 0.5, 0.2, -0.1)
    moved = np.roll(base, -2, axis=1)  # the second camera stands two pixels to the right
    moved[:, 6:] = 0.6  # hidden from the first camera
    found = carried_over(Painted(camera_at(0), wall(base), change), camera_at(0.25), wall(moved), 0)
    assert found == pytest.approx(np.where(moved > 0.5, 0.2, -0.1), abs=1e-6)
