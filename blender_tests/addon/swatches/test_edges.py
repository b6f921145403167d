"""Choke and feather of an object in Blender: the picture follows, and every edit has them."""

import json

import numpy as np
import pytest

from karf_engine.palettes.compositing import Planes, delta_composite, paper_composite, stack_palettes
from karf_engine.palettes.edge_planes import apply_edges_to_planes
from karf_engine.palettes.edge_shape import EdgeShape

from ..prepared import write_current_planes

RED, YELLOW, GRAY, BLUE = (0.8, 0.2, 0.1), (0.9, 0.9, 0.5), (0.5, 0.5, 0.5), (0.1, 0.3, 0.9)
HEIGHT, WIDTH = 16, 24


@pytest.fixture
def pots(addon, learned):
    """The scene with a red pot in the middle of a gray ground, and a lid that is nowhere."""
    coverage = np.zeros((2, HEIGHT, WIDTH), np.float16)
    coverage[1, 4:12, 6:18] = 1
    weights = np.zeros((2, 3, HEIGHT, WIDTH), np.float16)
    weights[1, 1] = coverage[1]
    base = np.where(coverage[1][..., None] > 0, RED, GRAY)
    planes = Planes(("lid", "pot"), weights, coverage, np.rint(255 * base).astype(np.uint8))
    write_current_planes(addon, learned, planes)
    addon.displayed.forget(learned)
    addon.steps.set_swatch(learned, "pot", 1, BLUE)
    return learned


def pixels(addon, scene):
    return addon.images.upright(addon.images.pixels(scene.karf.result))[..., :3].copy()


def row(addon, scene):
    """The blue of the picture's middle row, from left to right."""
    return pixels(addon, scene)[8, :, 2]


def pot(scene):
    return scene.karf.objects["pot"]


def test_the_picture_follows_and_both_at_0_bring_the_same_bits_back(addon, pots):
    before = pixels(addon, pots)
    pot(pots).choke = 2
    after = pixels(addon, pots)
    np.testing.assert_allclose(after[8, [6, 7, 16, 17]], [RED] * 4, atol=0.01)
    np.testing.assert_allclose(after[8, [8, 15]], [BLUE] * 2, atol=0.02)
    pot(pots).feather = 4
    assert len(np.unique(row(addon, pots).round(3))) > 3
    pot(pots).choke, pot(pots).feather = 0, 0
    np.testing.assert_array_equal(pixels(addon, pots), before)


def test_colors_and_edges_move_together(addon, pots):
    pot(pots).choke = 1
    for color in (YELLOW, BLUE, (0.3, 0.9, 0.2)):
        addon.steps.set_swatch(pots, "pot", 1, color)
        np.testing.assert_allclose(pixels(addon, pots)[8, 12], color, atol=0.02)
        np.testing.assert_allclose(pixels(addon, pots)[8, 6], RED, atol=0.01)
    pot(pots).choke = -1  # the pot grows again: what it had left is painted
    np.testing.assert_allclose(pixels(addon, pots)[8, 6], (0.3, 0.9, 0.2), atol=0.02)


@pytest.mark.parametrize("compositing", ["delta", "paper"])
def test_it_is_what_the_engine_composes(addon, pots, compositing):
    pots.karf.compositing = compositing
    pot(pots).choke, pot(pots).feather = -1.5, 3
    planes, palettes = addon.displayed.of(pots).view.planes, addon.colors.palettes(pots)
    scale = max(HEIGHT, WIDTH) / max(addon.captures.view_of(pots).camera.width, 1)
    weights, probabilities = apply_edges_to_planes(
        planes.base, planes.palette_weights, planes.probabilities, palettes, {"pot": EdgeShape(-1.5, 3)}, scale
    )
    edited = stack_palettes(planes.objects, {item.name: addon.colors.edited(item) for item in pots.karf.objects})
    learned = stack_palettes(planes.objects, {palette.name: palette.colors for palette in palettes})
    base = planes.base.astype(np.float32) / 255
    if compositing == "paper":
        right = paper_composite(base, weights, probabilities, edited)
    else:
        right = delta_composite(base, weights, learned, edited)
    np.testing.assert_allclose(pixels(addon, pots), right, atol=3e-3)  # the image has 8 bits


def test_an_added_color_keeps_its_pigment_up_to_the_new_edge(addon, pots):
    number = addon.steps.add_color(pots, "pot", RED, YELLOW)
    pot(pots).choke = 2
    np.testing.assert_allclose(pixels(addon, pots)[8, [7, 9]], [RED, YELLOW], atol=0.02)
    addon.steps.remove_color(pots, "pot", number)
    np.testing.assert_allclose(pixels(addon, pots)[8, [7, 9]], [RED, BLUE], atol=0.02)


def test_undo_brings_the_picture_along(bpy, addon, pots):
    bpy.ops.ed.undo_push(message="before")
    before = pixels(addon, pots)
    pot(pots).choke = 3
    changed = pixels(addon, pots)
    bpy.ops.ed.undo_push(message="choke")
    bpy.ops.ed.undo()
    np.testing.assert_array_equal(pixels(addon, bpy.context.scene), before)
    bpy.ops.ed.redo()
    np.testing.assert_array_equal(pixels(addon, bpy.context.scene), changed)


def test_keyframes_move_it(addon, pots):
    for frame, value in ((1, 0.0), (11, 2.0)):
        pot(pots).choke = value
        pot(pots).keyframe_insert("choke", frame=frame)
    pots.frame_set(1)
    np.testing.assert_allclose(pixels(addon, pots)[8, 6], BLUE, atol=0.02)
    pots.frame_set(11)
    np.testing.assert_allclose(pixels(addon, pots)[8, 6], RED, atol=0.02)


def test_edits_have_it_and_edit_files_keep_it(addon, pots, tmp_path):
    pot(pots).choke, pot(pots).feather = -1.5, 4
    assert addon.edits.current_edit(pots).edges == {"pot": addon.engine_api.EdgeShape(-1.5, 4)}
    assert addon.edits.edit_option(pots)["objects"]["pot"]["edges"] == {"choke": -1.5, "feather": 4}
    addon.steps.save_edit(pots, tmp_path / "edit.json")
    pot(pots).choke, pot(pots).feather, pots.karf.objects["lid"].choke = 0, 0, 3
    addon.steps.apply_edit(pots, tmp_path / "edit.json")
    assert (pot(pots).choke, pot(pots).feather, pots.karf.objects["lid"].choke) == (-1.5, 4, 0)
    content = json.loads((tmp_path / "edit.json").read_text())
    del content["objects"]["pot"]["edges"]
    (tmp_path / "older.json").write_text(json.dumps(content))
    addon.steps.apply_edit(pots, tmp_path / "older.json")
    assert (pot(pots).choke, pot(pots).feather) == (0, 0)


def test_other_tools_leave_it(addon, pots):
    pot(pots).choke = 1.5
    addon.steps.becomes(pots, "pot", RED, YELLOW)
    assert pot(pots).choke == 1.5
    addon.edits.reset(pots, "pot")
    assert pot(pots).choke == 1.5


def test_it_stays_where_palettes_are_learned_again(addon, pots):
    pot(pots).choke, pot(pots).feather = 1.5, 4
    make = addon.engine_api.Palette
    moved = np.array([(0, 0, 0), (0.1, 0.8, 0.1), RED], np.float32)
    addon.palettes.load_palettes(pots, [make("pot", moved), make("new", moved)])
    assert (pot(pots).choke, pot(pots).feather, pots.karf.objects["new"].choke) == (1.5, 4, 0)


def test_where_the_object_is_gone_it_is_kept_in_a_file(addon, pots):
    pots.karf.objects["lid"].feather = 3
    addon.palettes.load_palettes(pots, [palette for palette in addon.colors.palettes(pots) if palette.name == "pot"])
    (kept,) = (addon.folders.project_of(pots).folder / "edits").glob("kept-*.json")
    assert json.loads(kept.read_text())["objects"]["lid"]["edges"] == {"choke": 0.0, "feather": 3.0}


def test_frames_whose_edges_differ_have_edits_of_their_own(bpy, addon, pots, tmp_path):
    for frame, value in ((1, 0.0), (2, 2.0)):
        pot(pots).choke = value
        pot(pots).keyframe_insert("choke", frame=frame)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    pots.collection.objects.link(camera)
    _, files = addon.steps.render.write_sequence(pots, camera, (1, 2), tmp_path)
    assert len(set(files)) == 2
