"""Gaussians begin on the surface of a learned scene, flat and in its colors; what is behind is far away."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

torch = pytest.importorskip("torch")
pytest.importorskip("numba")

from blender_tests.engine.reference.still_life import BALL_CENTER, BALL_RADIUS, BOXES
from blender_tests.engine.splats.clouds import GROUPS
from karf_engine.errors import Cancelled
from karf_engine.metrics.images import psnr
from karf_engine.recolor.model import Model
from karf_engine.splats import start
from karf_engine.splats.kernels.arrays import COLOR, LOG_SCALE, ROTATION
from karf_engine.splats.rasterizer import rasterize
from karf_engine.splats.start import initial_gaussians, surface_views


@pytest.fixture(scope="module")
def model(learned):
    return Model.load(learned.project, "cpu")


@pytest.fixture(scope="module")
def begun(model):
    return initial_gaussians(model.scene, model.capture.split("train"), 3000, 1)


def distances_to_surface(points):
    """Of points [n, 3] to the still life's ball, block and slab."""
    found = [np.abs(np.linalg.norm(points - BALL_CENTER, axis=1) - BALL_RADIUS)]
    for low, high in BOXES.values():
        middle, half = (np.add(low, high)) / 2, np.subtract(high, low) / 2
        beyond = np.abs(points - middle) - half
        outside, inside = np.linalg.norm(beyond.clip(0), axis=1), beyond.max(1).clip(max=0)
        found.append(np.abs(outside + inside))
    return np.min(found, 0)


def axes_of(table):
    """Rotations [n, 3, 3] of the table's quaternions."""
    from blender_tests.engine.splats.torch_splats import rotations

    return rotations(torch.from_numpy(table[:, ROTATION : ROTATION + 4]).double()).numpy()


def test_disks_lie_on_the_surface(model, begun):
    voxel = 2.2 / 36
    distances = distances_to_surface(begun.table[: begun.n_foreground, :3])
    assert np.median(distances) < voxel and np.quantile(distances, 0.9) < 3 * voxel
    assert 1500 < begun.n_foreground < 6000 and begun.degree == 1


def test_disks_lie_flat_on_it(begun):
    table = begun.table[: begun.n_foreground]
    ball = np.linalg.norm(table[:, :3] - BALL_CENTER, axis=1) < BALL_RADIUS + 0.05
    outward = table[ball, :3] - BALL_CENTER
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    normals = axes_of(table[ball])[:, :, 2]
    assert np.median((outward * normals).sum(1)) > 0.9
    scales = np.exp(table[:, LOG_SCALE : LOG_SCALE + 3])
    assert_allclose(scales[:, 0], scales[:, 1])
    assert (scales[:, 2] < 0.5 * scales[:, 0]).all()


def test_colors_are_the_same_from_everywhere(begun):
    assert (begun.table[:, COLOR + 3 :] == 0).all() and begun.table[:, GROUPS["color"]].any()


def test_the_picture_is_that_of_the_field_before_anything_is_learned(model, begun):
    camera = model.working_camera(model.capture.split("test")[0])
    shown = rasterize(begun, camera).image[..., :3].clip(0, 1)
    assert psnr(shown, model.render_field(camera).color) > 18


def test_what_is_before_the_nearest_surface_is_shown_by_none(model, begun):
    nearest = min(
        np.linalg.norm(begun.table[:, :3] - view.camera.position, axis=1).min() for view in model.capture.views
    )
    assert 0 < begun.near < nearest


def test_a_plain_background_needs_no_gaussians(model, begun):
    assert begun.n_background == 0 and begun.background == (0, 0, 0)


def test_a_learned_background_becomes_a_shell_of_its_colors_behind_everything(model):
    def sky(viewdirs):
        return 0.5 + 0.4 * viewdirs

    views = model.capture.split("train")
    scene = replace(model.scene, background=sky)
    gaussians = initial_gaussians(scene, views, 1000, 0)
    shell = gaussians.table[gaussians.n_foreground :]
    assert len(shell) == start.BEHIND
    eyes = np.stack([view.camera.position for view in views])
    assert np.linalg.norm(shell[:, :3], axis=1).min() > 5 * np.linalg.norm(eyes, axis=1).max()
    alone = replace(gaussians, table=shell)
    camera = views[0].camera
    seen = rasterize(alone, camera).image
    assert seen[..., 3].max() < 0.03, "light comes through the shell"
    _, directions = camera.rays(camera.pixel_centers())
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    assert_allclose(seen[..., :3].reshape(-1, 3), sky(directions), atol=0.06)


@pytest.mark.parametrize("normal", [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0, -1, 0), (0.6, 0, -0.8), (1e-4, 0, -1)])
def test_a_disk_turns_to_its_normal(normal):
    normal = np.array([normal], np.float32) / np.linalg.norm(normal)
    table = np.zeros((1, COLOR), np.float32)
    table[:, ROTATION : ROTATION + 4] = start._rotations_to(normal)
    assert_allclose(axes_of(table)[0, :, 2], normal[0], atol=0.02)


@pytest.mark.parametrize(("count", "found"), [(1, 1), (3, 3), (64, 64), (65, 64), (1000, 64)])
def test_the_views_that_look_for_the_surface_are_spread_over_all(count, found):
    views = [SimpleNamespace(number=number) for number in range(count)]
    chosen = [view.number for view in surface_views(views)]
    assert len(set(chosen)) == len(chosen) == found and (chosen[0], chosen[-1]) == (0, count - 1)


def test_it_may_be_cancelled_after_each_view(model):
    steps = []

    def cancel():
        steps.append(1)
        if len(steps) == 3:
            raise Cancelled("The test wants it.")

    with pytest.raises(Cancelled):
        initial_gaussians(model.scene, model.capture.split("train"), 1000, 0, cancel)
    assert len(steps) == 3
