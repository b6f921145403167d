"""How far points are from an object's border, and splats whose edges are moved and faded."""

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("numba")

from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import View
from karf_engine.recolor.borders import measure_borders
from karf_engine.recolor.model import Model

SPACING, DEPTH, FOCAL = 0.02, 4.0, 100.0


@pytest.fixture(scope="module")
def floor():
    """Points of a floor of two units, in no grid; those right of its middle are a rug's, but for one stray."""
    steps = np.arange(-1, 1, SPACING)
    places = np.stack(np.meshgrid(steps, steps), -1).reshape(-1, 2)
    places += np.random.default_rng(0).uniform(-0.3 * SPACING, 0.3 * SPACING, places.shape)
    positions = np.column_stack([places, np.zeros(len(places))])
    is_rug = positions[:, 0] > 0
    is_rug[np.argmin(np.abs(places - (0.5, 0)).sum(1))] = False
    return positions, is_rug[:, None].astype(np.float32)


@pytest.fixture(scope="module")
def borders(floor):
    pose = np.eye(4)
    pose[2, 3] = DEPTH  # it looks down at the floor
    views = [View("above", "above", Camera(64, 64, FOCAL, FOCAL, 32, 32, pose), None, "train")]
    return measure_borders(*floor, np.ones(len(floor[0]), bool), views)


def test_distances_are_those_to_the_border_whatever_a_stray_says(floor, borders):
    positions, shares = floor
    off = borders.distances[:, 0] - positions[:, 0]
    assert (np.abs(off)[shares[:, 0] == (positions[:, 0] > 0)] < 1.5 * SPACING).all()
    assert np.abs(off.mean()) < 0.5 * SPACING


def test_a_pixel_spans_its_depth_over_the_focal_length(borders):
    assert borders.pixels[0] == pytest.approx(DEPTH / FOCAL, rel=1e-3)
    assert borders.spacings[0] == pytest.approx(SPACING, rel=0.4)


# --------------------------------------------------------------------------------------------------- a learned scene
@pytest.fixture(scope="module")
def model(learned):
    return Model.load(learned.project, "cpu")


@pytest.fixture(scope="module")
def green(model):
    return model.edit().becomes("ball", "#c0221a", "#1ec040")


def changed(model, edit):
    """Which Gaussians an edit changes, and by how much."""
    return np.abs(model.recolored_splats(edit).table - model.splats.table).sum(1)


def test_neutral_edges_change_no_bit_of_splats(model, green):
    before = model.recolored_splats(green).table
    np.testing.assert_array_equal(model.recolored_splats(green.edge("ball", 0, 0)).table, before)


def test_a_choke_recolors_fewer_gaussians_and_growth_more(model, green):
    plain, choked, grown = (changed(model, green.edge("ball", choke)) for choke in (0, 3, -3))
    assert (choked <= plain + 1e-6).all() and (grown >= plain - 1e-5).all()
    assert (choked > 0).sum() < (plain > 0).sum() < (grown > 0).sum()


def test_a_feather_leaves_gaussians_between_both_colors(model, green):
    plain, soft = changed(model, green), changed(model, green.edge("ball", 0, 16))
    share = soft[plain > 1e-2] / plain[plain > 1e-2]
    assert ((share > 0.1) & (share < 0.9)).sum() > 20


def test_any_cameras_picture_is_that_of_its_planes(model, green):
    camera = model.working_camera(model.capture.split("test")[1]).scaled(64, 64)
    edit = green.edge("ball", 2, 8)
    frame = model.render(camera)
    difference = np.abs(model.render_recolored(camera, edit) - model.composite(frame, edit))
    plain = np.abs(model.render_recolored(camera, green) - model.composite(frame, green))
    assert difference.mean() < 2 * plain.mean() + 1e-4
    assert np.abs(model.composite(frame, edit) - model.composite(frame, green)).max() > 0.05
