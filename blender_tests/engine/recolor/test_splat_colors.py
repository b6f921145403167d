"""Gaussians carry objects and palette weights: an edit in their colors is what composited planes show."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

torch = pytest.importorskip("torch")
pytest.importorskip("numba")

from blender_tests.engine.conftest import of_field
from karf_engine.errors import BadRequest
from karf_engine.metrics.images import psnr
from karf_engine.palettes.palette import AddedColor, Edit, Palette
from karf_engine.project import Project
from karf_engine.recolor import field_rendering
from karf_engine.recolor.frames import remove_background
from karf_engine.recolor.model import Model
from karf_engine.recolor.splatted_scene import bake_edit, render_planes, shares_of_objects, splats_of_objects
from karf_engine.splats.gaussians import Gaussians
from karf_engine.splats.kernels.arrays import C0, COLOR, LOG_SCALE, LOGIT, ROTATION
from karf_engine.splats.rasterizer import rasterize

RED, GREEN = "#c0221a", "#1ec040"


@pytest.fixture(scope="module")
def model(learned):
    return Model.load(learned.project, "cpu")


@pytest.fixture(scope="module")
def camera(model):
    return model.working_camera(model.capture.split("test")[1]).scaled(64, 64)


@pytest.fixture(scope="module")
def green(model):
    return model.edit().becomes("ball", RED, GREEN)


# ----------------------------------------------------------------------------------------------------------- the picture
def test_a_camera_sees_the_scene_its_objects_and_its_depth(model, camera):
    frame, truth = model.render(camera), of_field(model).render(camera)
    assert psnr(frame.color, truth.color) > 20
    assert_allclose(frame.opacity.mean(), truth.opacity.mean(), atol=0.05)
    both = frame.masks & truth.masks
    assert (both.sum((1, 2)) / (frame.masks | truth.masks).sum((1, 2))).min() > 0.7
    solid = (frame.opacity > 0.95) & (truth.opacity > 0.95)
    assert np.median(np.abs(frame.depth - truth.depth)[solid]) < 0.3  # the scene is two units wide


def test_weights_of_an_object_sum_to_its_probability(model, camera):
    frame = model.render(camera)
    assert_allclose(frame.palette_weights.sum(1), frame.probabilities, atol=1e-5)
    assert (frame.palette_weights >= 0).all() and frame.probabilities.sum(0).max() <= 1 + 1e-5


def test_the_field_shows_what_it_showed_before(model, camera, learned, tmp_path):
    without = Project(learned.project)
    frame = of_field(model).render(camera)
    assert of_field(model).splats is None and model.splats is not None and without.finished("splats")
    picture = model.scene.render(camera.without_distortion(), field_rendering.WEIGHT_SAMPLES)
    assert_array_equal(frame.color, picture.color.numpy())
    assert_array_equal(frame.probabilities, field_rendering.probabilities_of(model, picture))
    assert_array_equal(frame.palette_weights, field_rendering.weights_of_field(model, picture))


def test_without_numba_the_field_is_shown(learned, monkeypatch):
    monkeypatch.setenv("KARF_KERNELS", "off")
    assert Model.load(learned.project, "cpu").splats is None


def test_large_pictures_are_rendered_in_bands_that_fit_together(model, camera, monkeypatch):
    whole = model.render(camera)
    bands_of = field_rendering.split_bands
    monkeypatch.setattr(field_rendering, "split_bands", lambda camera, count: bands_of(camera, count, 64 * 16))
    parts = model.render(camera)
    for name in ("color", "opacity", "probabilities", "palette_weights"):
        assert_allclose(getattr(parts, name), getattr(whole, name), atol=5e-3, err_msg=name)


def test_a_finer_picture_averages_to_the_plain_one(model, camera):
    plain, fine = model.render(camera), model.render(camera, 2)
    assert psnr(plain.color, fine.color) > 25


# ---------------------------------------------------------------------------------------------------------------- edits
def test_an_edit_that_changes_nothing_keeps_all_bits(model):
    assert_array_equal(model.recolored_splats(model.edit()).table, model.splats.table)


def test_an_edit_in_the_colors_is_what_the_planes_composite(model, camera, green):
    planes = model.composite(model.render(camera), green)
    baked = rasterize(model.recolored_splats(green), camera).image[..., :3].clip(0, 1)
    unchanged = model.render(camera).color
    assert np.abs(planes - unchanged).max() > 0.3
    assert psnr(baked, planes) > 30
    assert np.abs(baked - planes).mean() < 0.01


def test_only_the_edited_object_changes(model, green):
    changed = (model.recolored_splats(green).table != model.splats.table).any(1)
    shares = model.splatted.shares
    assert changed.any() and (shares[changed, model.objects.index("ball")] > 0).all()
    assert not changed[model.splats.n_foreground :].any()
    assert_array_equal(model.recolored_splats(green).table[:, :COLOR], model.splats.table[:, :COLOR])


def test_the_last_edit_is_kept(model, green):
    assert model.recolored_splats(green) is model.recolored_splats(green)
    assert model.recolored_splats(model.edit()) is not model.recolored_splats(green)


def test_shares_are_those_of_f_s_and_nothing_outside_its_boxes(model):
    table = model.splats.table.copy()
    table[::3, :3] += 5
    moved = replace(model.splats, table=table)
    shares = shares_of_objects(moved, model.segmentation, model.scene)
    centers = model.scene.field.space.to_grid(torch.from_numpy(table[:, :3]))
    inside = model.segmentation.inside(centers).any(1).numpy()
    assert inside.any() and not inside[::3].any()
    assert_allclose(shares[inside], model.splatted.shares[inside], atol=1e-5)
    assert (shares[~inside] == 0).all() and (shares >= 0).all() and (shares.sum(1) <= 1 + 1e-5).all()


def test_what_is_behind_is_never_of_an_object(model):
    behind = replace(model.splats, n_background=len(model.splats))
    assert not shares_of_objects(behind, model.segmentation, model.scene).any()


def test_an_edit_that_replaces_colors_cannot_be_baked(model):
    with pytest.raises(BadRequest, match="cannot be baked") as caught:
        model.recolored_splats(replace(model.edit(), compositing="paper"))
    assert caught.value.hint


def test_without_splats_there_is_nothing_to_bake_into(model):
    with pytest.raises(BadRequest, match="no finished splats"):
        of_field(model).recolored_splats(model.edit())


def test_an_added_color_moves_what_is_near_its_hue(model, camera):
    edit = model.edit()
    palette = next(each for each in model.palettes if each.name == "ball")
    picked = AddedColor(np.float32([0.75, 0.13, 0.1]))
    sets = np.concatenate([edit.colors["ball"], palette.colors])
    same = replace(edit, colors=edit.colors | {"ball": sets}, added={"ball": (picked,)})
    assert_array_equal(model.recolored_splats(same).table, model.splats.table)
    bluer = sets.copy()
    bluer[len(palette.colors) :, 2] += 0.5
    changed = replace(same, colors=edit.colors | {"ball": bluer})
    baked = rasterize(model.recolored_splats(changed), camera).image[..., :3].clip(0, 1)
    planes = model.composite(model.render(camera), changed)
    assert np.abs(baked - model.render(camera).color).max() > 0.1
    assert psnr(baked, planes) > 25


# ------------------------------------------------------------------------------------------------- colors of one Gaussian
def one(color, harmonics=0.0):
    """One Gaussian of this color, whose first harmonic reddens it to one side."""
    table = np.zeros((1, COLOR + 12), np.float32)
    table[0, LOG_SCALE:ROTATION], table[0, ROTATION], table[0, LOGIT] = -1, 1, 4
    table[0, COLOR : COLOR + 3] = (np.array(color) - 0.5) / C0
    table[0, COLOR + 3] = harmonics
    return Gaussians(table, 0, (0, 0, 0), 0.1)


PALETTE = Palette("pot", np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 1]]))


def baked(gaussians, colors, share=1.0):
    objects = splats_of_objects(gaussians, np.full((1, 1), share, np.float32), [PALETTE], {})
    edit = Edit({"pot": np.float32(colors)})
    return bake_edit(gaussians, objects, [PALETTE], edit)


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_a_color_moves_by_its_weights_and_its_share(share):
    gaussians = one((0.6, 0, 0))
    moved = baked(gaussians, [[0, 0, 0], [0, 0, 1], [1, 1, 1]], share)
    color = 0.5 + C0 * moved.table[0, COLOR : COLOR + 3]
    assert_allclose(color, [0.6 - share * 0.6, 0, share * 0.6], atol=1e-5)


def test_shading_takes_the_new_hue_too():
    moved = baked(one((0.6, 0, 0), 0.2), [[0, 0, 0], [0, 0, 1], [1, 1, 1]])
    assert_allclose(moved.table[0, COLOR + 3 : COLOR + 6], [0, 0, 0.2], atol=0.02)
    unshaded = baked(one((0.6, 0, 0)), [[0, 0, 0], [0, 0, 1], [1, 1, 1]])
    assert not unshaded.table[0, COLOR + 3 :].any()


def test_an_object_without_gaussians_has_empty_planes(camera):
    gaussians = one((0.6, 0, 0))
    objects = splats_of_objects(gaussians, np.zeros((1, 1), np.float32), [PALETTE], {})
    probabilities, weights = render_planes(rasterize(gaussians, camera), gaussians, objects)
    assert probabilities.shape == (1, 64, 64) and weights.shape == (1, 3, 64, 64)
    assert not probabilities.any() and not weights.any()


# --------------------------------------------------------------------------------------------------------------- behind
def test_what_is_cut_out_gives_the_picture_again_on_what_is_behind(model, camera):
    frame, behind = model.render(camera), model.render_background(camera)
    assert_array_equal(behind, np.zeros_like(behind))  # the capture's black
    cut = remove_background(frame.color, frame.opacity, behind)
    assert_allclose(cut[..., :3] * cut[..., 3:] + behind * (1 - cut[..., 3:]), frame.color, atol=2e-3)
    assert cut[..., 3].min() < 0.01 and cut[..., 3].max() > 0.99


def test_the_shell_is_behind_and_no_part_of_the_cut_out(model, camera):
    blue = np.zeros((1, model.splats.table.shape[1]), np.float32)
    blue[0, :3] = camera.camera_to_world[:3, 3] - 40 * camera.camera_to_world[:3, 2]
    blue[0, LOG_SCALE:ROTATION], blue[0, ROTATION], blue[0, LOGIT] = np.log(60), 1, 9
    blue[0, COLOR : COLOR + 3] = (np.array([0, 0, 1]) - 0.5) / C0
    table = np.concatenate([model.splats.table, blue])
    own = Model.load(model.project.folder, "cpu")
    own.splatted.gaussians = replace(model.splats, table=table, n_background=1, visibility=None)
    frame, plain = own.render(camera), model.render(camera)
    assert_allclose(frame.opacity, plain.opacity, atol=1e-4)
    assert_allclose(frame.depth, plain.depth, atol=1e-3)
    assert own.render_background(camera)[32, 32, 2] > 0.9 and frame.color[0, 0, 2] > 0.8
