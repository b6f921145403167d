"""Protect Neutrals: red letters on silver change, and the silver, of which the red swatch is a part, stays."""

import numpy as np
import pytest

from karf_engine.palettes.color_histogram import ColorHistogram, write_object_colors
from karf_engine.palettes.compositing import Planes
from karf_engine.palettes.palette import Palette, write_palettes

from ..prepared import write_current_planes

GREEN = (0.1, 0.6, 0.15)
PALETTE = np.array([[0, 0, 0], [0.9, 0.05, 0.1], [0.65, 0.85, 0.85]], np.float32)
LETTERS, SILVER = np.array([0.1, 0.9, 0.0]), np.array([0.05, 0.2, 0.75])  # shares of the palette


@pytest.fixture
def can(addon, learned):
    """A can whose letters are on the left of the picture, and its silver on the right."""
    weights = np.zeros((1, 3, 16, 24), np.float16)
    weights[0, :, :, :12], weights[0, :, :, 12:] = LETTERS[:, None, None], SILVER[:, None, None]
    base = np.rint(255 * np.moveaxis(weights[0].astype(float), 0, -1) @ PALETTE).astype(np.uint8)
    shares = np.stack([LETTERS, SILVER])
    project, palettes = addon.folders.project_of(learned), [Palette("can", PALETTE)]
    write_palettes(project.palette_file, palettes, shared=False)
    write_object_colors(project.object_colors_file, {"can": ColorHistogram(shares @ PALETTE, np.ones(2), shares)})
    write_current_planes(addon, learned, Planes(("can",), weights, weights.sum(1), base))
    addon.palettes.import_learned(learned)
    addon.displayed.forget(learned)
    addon.displayed.of(learned).refresh()
    return learned.karf.objects["can"]


def shown(addon, scene):
    """The letters' color and the silver's, [2, 3]."""
    return np.array(addon.images.pixels(scene.karf.result)[8, [6, 18], :3])


def test_the_silver_is_silver_again_and_the_letters_keep_their_new_color(addon, learned, can):
    before = shown(addon, learned)
    learned.karf.material = False  # which would hold the silver of so plain a can
    can.swatches[1].color = GREEN
    dragged = shown(addon, learned)
    assert np.abs(dragged[1] - before[1]).max() > 0.05  # mint
    number = addon.steps.protect_neutrals(learned, "can", 1)
    letters, silver = shown(addon, learned)
    np.testing.assert_allclose(letters, dragged[0], atol=0.02)
    np.testing.assert_allclose(silver, before[1], atol=0.01)
    np.testing.assert_allclose(can.swatches[1].color, PALETTE[1], atol=1e-6)
    can.swatches[number].color = (0.1, 0.1, 0.8)
    letters, silver = shown(addon, learned)
    assert letters[2] > 0.6
    np.testing.assert_allclose(silver, before[1], atol=0.01)


def test_an_added_color_is_only_told_so(bpy, addon, learned, can):
    number = addon.steps.add_color(learned, "can", tuple(LETTERS @ PALETTE), reach=2.0, protect=0.0)
    bpy.ops.karf.solo_swatch(object_name="can", index=number)
    assert shown(addon, learned)[:, 0].min() > 0.5  # its hue is all that counts
    assert addon.steps.protect_neutrals(learned, "can", number) == number
    letters, silver = shown(addon, learned)[:, 0]
    bpy.context.window_manager.karf_seeing.mode = "EDITED"
    assert letters > 0.8 and silver < 0.01
    assert can.swatches[number].protect == pytest.approx(addon.engine_api.PROTECT)


def test_a_click_proposes_it_and_what_is_given_counts(bpy, addon, can):
    red = tuple(LETTERS @ PALETTE)
    proposed = addon.steps.add_color(bpy.context.scene, "can", red)
    given = addon.steps.add_color(bpy.context.scene, "can", red, reach=0.5, protect=0.0)
    assert (
        can.swatches[proposed].protect == pytest.approx(addon.engine_api.PROTECT) and can.swatches[given].protect == 0
    )


def test_one_button_and_undo(bpy, addon, learned, can):
    can.swatches[1].color = GREEN
    bpy.ops.ed.undo_push(message="dragged")
    assert bpy.ops.karf.protect_neutrals(object_name="can", index=1) == {"FINISHED"}
    bpy.ops.ed.undo_push(message="protected")
    bpy.ops.ed.undo()
    scene = bpy.context.scene
    assert len(scene.karf.objects["can"].swatches) == 3
    np.testing.assert_allclose(scene.karf.objects["can"].swatches[1].color, GREEN, atol=1e-6)


def test_an_edit_keeps_it(addon, learned, can, tmp_path):
    addon.steps.add_color(learned, "can", tuple(LETTERS @ PALETTE), GREEN, reach=0.75, protect=0.25)
    addon.steps.save_edit(learned, tmp_path / "edit.json")
    addon.steps.remove_color(learned, "can", 3)
    addon.steps.apply_edit(learned, tmp_path / "edit.json")
    assert (can.swatches[3].reach, can.swatches[3].protect) == (0.75, 0.25)
