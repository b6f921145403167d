"""Edits baked into Gaussians against composites of their planes, and edges, cutouts and the background."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose, assert_array_equal

pytest.importorskip("numba")

from blender_tests.engine.conftest import of_field
from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import View
from karf_engine.errors import BadRequest
from karf_engine.fields.scene import Picture
from karf_engine.metrics.images import psnr
from karf_engine.palettes.palette import AddedColor, Edit, Palette
from karf_engine.recolor import field_rendering
from karf_engine.recolor.borders import measure_borders
from karf_engine.recolor.frames import Frame, downsample, remove_background
from karf_engine.recolor.model import Model
from karf_engine.recolor.splatted_scene import bake_edit, render_planes, shares_of_objects, splats_of_objects
from karf_engine.splats.gaussians import Gaussians
from karf_engine.splats.kernels.arrays import C0, COLOR, LOG_SCALE, LOGIT, ROTATION
from karf_engine.splats.rasterizer import rasterize

PALETTE = Palette("pot", np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 1]]))
BLUE = Edit({"pot": np.float32([[0, 0, 0], [0, 0, 1], [1, 1, 1]])})


@pytest.fixture(scope="module")
def model(learned):
    return Model.load(learned.project, "cpu")


@pytest.fixture(scope="module")
def camera(model):
    return model.working_camera(model.capture.split("test")[1]).scaled(64, 64)


@pytest.fixture(scope="module")
def frame(model, camera):
    return model.render(camera)


@pytest.fixture(scope="module")
def green(model):
    return model.edit().becomes("ball", "#c0221a", "#1ec040")


def render_baked(model, edit, camera):
    """The picture of the Gaussians in an edit's colors."""
    return rasterize(model.recolored_splats(edit), camera).image[..., :3].clip(0, 1)


def test_splats_render_the_scene_its_objects_and_depth(model, camera, frame):
    truth = of_field(model).render(camera)
    assert psnr(frame.color, truth.color) > 20
    assert_allclose(frame.opacity.mean(), truth.opacity.mean(), atol=0.05)
    both = frame.masks & truth.masks
    assert (both.sum((1, 2)) / (frame.masks | truth.masks).sum((1, 2))).min() > 0.7
    solid = (frame.opacity > 0.95) & (truth.opacity > 0.95)
    assert np.median(np.abs(frame.depth - truth.depth)[solid]) < 0.3  # the scene is two units wide
    assert_allclose(frame.palette_weights.sum(1), frame.probabilities, atol=1e-5)
    assert (frame.palette_weights >= 0).all() and frame.probabilities.sum(0).max() <= 1 + 1e-5


def test_field_renders_when_chosen_or_without_numba(model, camera, monkeypatch):
    field = of_field(model)
    found = field.render(camera)
    assert field.splats is None and model.splats is not None
    picture = model.scene.render(camera.without_distortion(), field_rendering.WEIGHT_SAMPLES)
    assert_array_equal(found.color, picture.color.numpy())
    assert_array_equal(found.probabilities, field_rendering.probabilities_of(model, picture))
    assert_array_equal(found.palette_weights, field_rendering.weights_of_field(model, picture))
    with pytest.raises(BadRequest, match="no finished splats"):
        field.recolored_splats(field.edit())
    monkeypatch.setenv("KARF_KERNELS", "off")
    assert Model.load(model.project.folder, "cpu").splats is None


def test_bands_join_and_supersampling_averages_to_the_plain_picture(model, camera, frame, monkeypatch):
    split = field_rendering.split_bands
    monkeypatch.setattr(field_rendering, "split_bands", lambda camera, count: split(camera, count, 64 * 16))
    parts = model.render(camera)
    for name in ("color", "opacity", "probabilities", "palette_weights"):
        assert_allclose(getattr(parts, name), getattr(frame, name), atol=5e-3, err_msg=name)
    assert psnr(frame.color, model.render(camera, 2).color) > 25


def test_downsampling_averages_colors_and_picks_a_depth():
    depth = np.array([[2, 2, 0, 0, 0, 0], [2, 9, 0, 7, 0, 0]], np.float32)
    color = np.repeat(depth[..., None] / 10, 3, -1)
    picture = Picture(torch.tensor(color), torch.tensor((depth > 0).astype(np.float32)), torch.tensor(depth), None)
    small = downsample(Frame(picture, (depth > 0)[None].astype(np.float32), None, color), 2)
    assert_allclose(small.color[0, :, 0], [0.375, 0.175, 0])
    assert_allclose(small.opacity, [[1, 0.25, 0]])
    assert_allclose(small.probabilities, [[[1, 0.25, 0]]])
    assert_allclose(small.depth, [[2, 7, 0]])


def test_baked_edit_matches_composited_planes(model, camera, frame, green):
    planes, baked = model.composite(frame, green), render_baked(model, green, camera)
    assert np.abs(planes - frame.color).max() > 0.3
    assert psnr(baked, planes) > 30 and np.abs(baked - planes).mean() < 0.01
    with pytest.raises(BadRequest, match="cannot be baked") as caught:
        model.recolored_splats(replace(green, compositing="paper"))  # which replaces colors
    assert caught.value.hint


def test_baking_changes_only_the_edited_object(model, green):
    assert_array_equal(model.recolored_splats(model.edit()).table, model.splats.table)
    changed = (model.recolored_splats(green).table != model.splats.table).any(1)
    assert changed.any() and (model.splatted.shares[changed, model.objects.index("ball")] > 0).all()
    assert not changed[model.splats.n_foreground :].any()
    assert_array_equal(model.recolored_splats(green).table[:, :COLOR], model.splats.table[:, :COLOR])
    assert model.recolored_splats(green) is model.recolored_splats(green)  # the last edit is kept


def test_shares_follow_f_s_and_vanish_outside_boxes_and_behind(model):
    table = model.splats.table.copy()
    table[::3, :3] += 5
    shares = shares_of_objects(replace(model.splats, table=table), model.segmentation, model.scene)
    centers = model.scene.field.space.to_grid(torch.from_numpy(table[:, :3]))
    inside = model.segmentation.inside(centers).any(1).numpy()
    assert inside.any() and not inside[::3].any()
    assert_allclose(shares[inside], model.splatted.shares[inside], atol=1e-5)
    assert (shares[~inside] == 0).all() and (shares >= 0).all() and (shares.sum(1) <= 1 + 1e-5).all()
    behind = replace(model.splats, n_background=len(model.splats))
    assert not shares_of_objects(behind, model.segmentation, model.scene).any()


def test_added_color_moves_nearby_hues(model, camera, frame):
    edit = model.edit()
    palette = next(each for each in model.palettes if each.name == "ball")
    sets = np.concatenate([edit.colors["ball"], palette.colors])
    added = {"ball": (AddedColor(np.float32([0.75, 0.13, 0.1])),)}
    same = replace(edit, colors=edit.colors | {"ball": sets.copy()}, added=added)
    assert_array_equal(model.recolored_splats(same).table, model.splats.table)
    sets[len(palette.colors) :, 2] += 0.5
    changed = replace(same, colors=edit.colors | {"ball": sets})
    baked = render_baked(model, changed, camera)
    assert np.abs(baked - frame.color).max() > 0.1
    assert psnr(baked, model.composite(frame, changed)) > 25


def test_choke_growth_and_feather_change_how_many_gaussians_recolor(model, green):
    edits = [green, *(green.edge("ball", *edge) for edge in [(3, 0), (0, 0), (-3, 0), (0, 16)])]
    tables = [model.recolored_splats(edit).table for edit in edits]
    plain, choked, same, grown, soft = (np.abs(table - model.splats.table).sum(1) for table in tables)
    assert_array_equal(same, plain)
    assert (choked <= plain + 1e-6).all() and (grown >= plain - 1e-5).all()
    assert (choked > 0).sum() < (plain > 0).sum() < (grown > 0).sum()
    share = soft[plain > 1e-2] / plain[plain > 1e-2]
    assert ((share > 0.1) & (share < 0.9)).sum() > 20


def test_rendered_edit_matches_composited_planes_with_edges(model, camera, frame, green):
    edit = green.edge("ball", 2, 8)
    off, plain = (np.abs(model.render_recolored(camera, e) - model.composite(frame, e)).mean() for e in (edit, green))
    assert off < 2 * plain + 1e-4
    assert np.abs(model.composite(frame, edit) - model.composite(frame, green)).max() > 0.05


def test_border_distances_ignore_strays_and_pixels_scale_with_depth():
    """A floor of jittered points: those right of its middle are a rug's, except for a stray one."""
    spacing, depth, focal = 0.02, 4.0, 100.0
    places = np.stack(np.meshgrid(*[np.arange(-1, 1, spacing)] * 2), -1).reshape(-1, 2)
    places += np.random.default_rng(0).uniform(-0.3 * spacing, 0.3 * spacing, places.shape)
    positions = np.column_stack([places, np.zeros(len(places))])
    is_rug = positions[:, 0] > 0
    stray = np.argmin(np.abs(places - (0.5, 0)).sum(1))
    is_rug[stray] = False
    pose = np.eye(4)
    pose[2, 3] = depth  # the camera looks down at the floor
    views = [View("above", "above", Camera(64, 64, focal, focal, 32, 32, pose), None, "train")]
    borders = measure_borders(positions, is_rug[:, None].astype(np.float32), np.ones(len(places), bool), views)
    off = borders.distances[:, 0] - positions[:, 0]
    assert (np.abs(np.delete(off, stray)) < 1.5 * spacing).all() and np.abs(off.mean()) < 0.5 * spacing
    assert borders.pixels[0] == pytest.approx(depth / focal, rel=1e-3)
    assert borders.spacings[0] == pytest.approx(spacing, rel=0.4)


def gaussian(harmonics=0.0):
    """A dark red Gaussian whose first harmonic reddens one side."""
    table = np.zeros((1, COLOR + 12), np.float32)
    table[0, LOG_SCALE:ROTATION], table[0, ROTATION], table[0, LOGIT] = -1, 1, 4
    table[0, COLOR : COLOR + 3] = (np.array([0.6, 0, 0]) - 0.5) / C0
    table[0, COLOR + 3] = harmonics
    return Gaussians(table, 0, (0, 0, 0), 0.1)


def bake_blue(gaussians, share=1.0):
    objects = splats_of_objects(gaussians, np.full((1, 1), share, np.float32), [PALETTE], {})
    return bake_edit(gaussians, objects, [PALETTE], BLUE).table[0]


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_color_and_shading_move_by_weight_and_share(share):
    plain, shaded = bake_blue(gaussian(), share), bake_blue(gaussian(0.2))
    assert_allclose(0.5 + C0 * plain[COLOR : COLOR + 3], [0.6 - share * 0.6, 0, share * 0.6], atol=1e-5)
    assert not plain[COLOR + 3 :].any()
    assert_allclose(shaded[COLOR + 3 : COLOR + 6], [0, 0, 0.2], atol=0.02)


def test_object_without_gaussians_has_empty_planes(camera):
    splats = gaussian()
    objects = splats_of_objects(splats, np.zeros((1, 1), np.float32), [PALETTE], {})
    probabilities, weights = render_planes(rasterize(splats, camera), splats, objects)
    assert probabilities.shape == (1, 64, 64) and weights.shape == (1, 3, 64, 64)
    assert not probabilities.any() and not weights.any()


@pytest.mark.parametrize("background", [0.0, 0.4, 1.0])
def test_cutout_on_its_background_restores_the_picture(background):
    own, opacity = np.random.default_rng(0).random((4, 5, 3)), np.linspace(0, 1, 20).reshape(4, 5)
    behind = np.full((4, 5, 3), background)
    picture = own * opacity[..., None] + behind * (1 - opacity[..., None])
    cut = remove_background(picture, opacity, behind)
    assert_allclose(cut[..., 3], opacity, atol=1e-6)
    assert_allclose(cut[..., :3] * cut[..., 3:] + behind * (1 - cut[..., 3:]), picture, atol=1e-6)
    assert (cut[0, 0] == 0).all()


def test_background_shell_stays_behind_the_cutout(model, camera, frame):
    blue = np.zeros((1, model.splats.table.shape[1]), np.float32)
    blue[0, :3] = camera.camera_to_world[:3, 3] - 40 * camera.camera_to_world[:3, 2]
    blue[0, LOG_SCALE:ROTATION], blue[0, ROTATION], blue[0, LOGIT] = np.log(60), 1, 9
    blue[0, COLOR : COLOR + 3] = (np.array([0, 0, 1]) - 0.5) / C0
    table = np.concatenate([model.splats.table, blue])
    own = Model.load(model.project.folder, "cpu")
    own.splatted.gaussians = replace(model.splats, table=table, n_background=1, visibility=None)
    on_blue = own.render(camera)
    assert_allclose(on_blue.opacity, frame.opacity, atol=1e-4)
    assert_allclose(on_blue.depth, frame.depth, atol=1e-3)
    assert own.render_background(camera)[32, 32, 2] > 0.9 and on_blue.color[0, 0, 2] > 0.8
    assert frame.opacity.min() < 0.01 and frame.opacity.max() > 0.99
    assert_array_equal(model.render_background(camera), np.zeros((64, 64, 3)))  # the capture's black
