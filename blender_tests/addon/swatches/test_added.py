"""Added colors: the pixels they move, the tools that treat them as swatches, and protected neutrals."""

from pathlib import Path

import numpy as np
import pytest

from karf_engine.palettes.color_histogram import ColorHistogram, write_object_colors
from karf_engine.palettes.palette import write_palettes

from .scenes import BLUE, GREEN, HEIGHT, RED, WIDTH, YELLOW, color, halves, palettes, pixels, show, show_halves


@pytest.fixture
def pots(addon, learned):
    """The scene with a pot, red on the left and yellow on the right."""
    show_halves(addon, learned)
    return learned


def assert_shows(addon, scene, *wanted, atol=0.02):
    np.testing.assert_allclose(halves(addon, scene), wanted, atol=atol)


def test_adding_a_color_keeps_the_picture(bpy, addon, pots):
    addon.steps.set_swatch(pots, "pot", 1, GREEN)
    before, swatches = pixels(addon, pots), pots.karf.objects["pot"].swatches
    assert bpy.ops.karf.add_color(object_name="pot", picked=YELLOW) == {"FINISHED"}
    np.testing.assert_array_equal(pixels(addon, pots), before)
    assert [index for index, each in enumerate(swatches) if index and not each.merged] == [1, 2, 3]
    np.testing.assert_allclose(color(pots, "pot", 3), YELLOW, atol=1e-6)
    assert [len(palette.colors) for palette in addon.colors.palettes(pots)] == [3, 3]


def test_added_color_alone_moves_its_pigment(addon, pots):
    assert addon.steps.add_color(pots, "pot", YELLOW, BLUE) == 3
    assert_shows(addon, pots, RED, BLUE)
    addon.steps.set_swatch(pots, "pot", 2, (0, 0, 0))
    addon.steps.set_swatch(pots, "pot", 1, GREEN)
    assert_shows(addon, pots, GREEN, BLUE)
    addon.steps.remove_color(pots, "pot", 3)
    assert_shows(addon, pots, GREEN, (0, 0, 0), atol=0.01)
    assert len(pots.karf.objects["pot"].swatches) == 3


def test_added_color_is_picked_as_learned_and_starts_as_shown(addon, pots):
    addon.steps.set_swatch(pots, "pot", 2, BLUE)
    number = addon.steps.add_color(pots, "pot", YELLOW)
    np.testing.assert_allclose(color(pots, "pot", number), BLUE, atol=1e-6)
    assert_shows(addon, pots, RED, BLUE)
    addon.edits.reset(pots, "pot", number)
    assert_shows(addon, pots, RED, YELLOW, atol=0.01)
    addon.steps.set_swatch(pots, "pot", 1, BLUE)
    picked = [addon.steps.color_at(pots, "pot", (x, 0.5)) for x in (0.2, 0.8)]
    np.testing.assert_allclose(picked, [RED, YELLOW], atol=1e-3)
    for name, place in (("lid", (0.2, 0.5)), ("pot", (-1, -1)), ("pot", (0.5, 1.2))):
        with pytest.raises(addon.engine_api.BadRequest, match="is not at this place"):
            addon.steps.color_at(pots, name, place)


def test_reach_widens_the_hue_range_and_solo_shows_weights(bpy, addon, pots):
    number = addon.steps.add_color(pots, "pot", YELLOW, BLUE)
    swatch = pots.karf.objects["pot"].swatches[number]
    swatch.reach = 3.0
    assert np.abs(halves(addon, pots)[0] - RED).max() > 0.1
    swatch.reach = 0.5
    assert_shows(addon, pots, RED, BLUE)
    bpy.ops.karf.solo_swatch(object_name="pot", index=number)
    np.testing.assert_allclose(halves(addon, pots)[:, 0], [0, 1], atol=0.01)
    bpy.context.window_manager.karf_seeing.mode = "EDITED"


def test_links_becomes_and_matches_respect_an_added_color(addon, pots):
    number = addon.steps.add_color(pots, "pot", YELLOW, BLUE)
    addon.steps.becomes(pots, "pot", RED, GREEN)
    assert_shows(addon, pots, GREEN, BLUE, atol=0.03)
    image = addon.steps.paint_over(pots)
    painted = addon.images.pixels(image)
    painted[:, :12, :3] = RED
    addon.images.upload(image, painted)
    (found,) = addon.steps.match_picture(pots)
    assert found.after < 0.5
    assert_shows(addon, pots, RED, BLUE, atol=0.03)
    addon.steps.link_swatches(pots, ("pot", number), ("lid", 1))
    addon.steps.set_swatch(pots, "lid", 1, GREEN)
    assert_shows(addon, pots, RED, GREEN, atol=0.03)


def test_removing_an_added_color_keeps_others_and_their_keyframes(addon, pots):
    first, second = addon.steps.add_color(pots, "pot", YELLOW), addon.steps.add_color(pots, "pot", RED)
    swatches = pots.karf.objects["pot"].swatches
    for number in (first, second):
        swatches[number].keyframe_insert("color", frame=1)
    kept = addon.engine_api.rgb_to_hex(swatches[first].learned)
    addon.steps.remove_color(pots, "pot", first)
    assert [each.merged for each in swatches[3:]] == [0, 3, 3]
    paths = {curve.data_path for curve in addon.compat.curves_of(pots.animation_data)}
    assert paths == {"karf.objects[1].swatches[3].color", f'karf.objects["pot"].swatches["{kept}"].color'}
    addon.steps.set_swatch(pots, "pot", 3, BLUE)
    assert_shows(addon, pots, BLUE, YELLOW)


def test_added_color_survives_palette_extraction(addon, pots):
    addon.steps.add_color(pots, "pot", YELLOW, BLUE)
    pots.karf.objects["pot"].swatches[3].keyframe_insert("color", frame=1)
    pot, lid = *palettes(addon, pot=[(0.1, 0.8, 0.1), RED, YELLOW]), addon.colors.palettes(pots)[0]
    seen = {"pot": ColorHistogram(pot.colors[1:], np.ones(3), np.eye(4)[1:])}
    write_object_colors(addon.folders.project_of(pots).object_colors_file, seen)
    addon.palettes.load_palettes(pots, [pot, lid])
    swatches = pots.karf.objects["pot"].swatches
    assert [index for index, each in enumerate(swatches) if index and not each.merged] == [1, 2, 3, 4]
    np.testing.assert_allclose(color(pots, "pot", 4), BLUE, atol=1e-6)
    (curve, *_) = addon.compat.curves_of(pots.animation_data)
    assert curve.data_path == "karf.objects[0].swatches[4].color"
    np.testing.assert_allclose(swatches[7].color, BLUE, atol=0.02)  # in the added color's own palette


def test_compositor_and_3d_points_use_an_added_color(bpy, addon, pots):
    (request,) = addon.steps.build_compositor(pots).requests
    assert request.options["edit"] is None
    addon.steps.add_color(pots, "pot", YELLOW, BLUE)
    (request,) = addon.steps.build_compositor(pots).requests
    learned = addon.colors.palettes(pots)
    edit = addon.engine_api.read_edit_file(Path(request.options["edit"]), learned)
    assert len(edit.added["pot"]) == 1 and len(edit.colors["pot"]) == 6
    zeros, weights = np.zeros((2, 3), np.float32), np.zeros((2, 2, 3), np.float16)
    weights[0, 1, 1] = weights[1, 1, 2] = 1
    normals, sizes, seen = zeros + [0, 0, 1], zeros[:, 0] + 1, np.rint(255 * np.array([RED, YELLOW])).astype(np.uint8)
    parts = zeros, normals, sizes, seen, weights.sum(2), weights, np.stack([each.colors for each in learned])
    file = addon.folders.project_of(pots).points_file
    addon.engine_api.write_points(file, addon.engine_api.ScenePoints(("lid", "pot"), *parts))
    item, flat = addon.steps.place_points(pots, file), np.empty(32, np.float32)
    for wanted in (BLUE, GREEN):
        addon.steps.set_swatch(pots, "pot", 3, wanted)
        data = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        data.attributes["Color"].data.foreach_get("color_srgb", flat)
        np.testing.assert_allclose(flat.reshape(2, 4, 4)[:, 0, :3], [RED, wanted], atol=0.02)


CAN = np.array([[0, 0, 0], [0.9, 0.05, 0.1], [0.65, 0.85, 0.85]], np.float32)
LETTERS, SILVER = np.array([0.1, 0.9, 0.0]), np.array([0.05, 0.2, 0.75])  # palette weights


@pytest.fixture
def can(addon, learned):
    """A can with red letters on the left of the picture, and silver with some red in it on the right."""
    shares = np.stack([LETTERS, SILVER])
    weights = shares.repeat(WIDTH // 2, 0).T[None, :, None].repeat(HEIGHT, 2)
    project = addon.folders.project_of(learned)
    write_palettes(project.palette_file, palettes(addon, can=CAN[1:]), shared=False)
    write_object_colors(project.object_colors_file, {"can": ColorHistogram(shares @ CAN, np.ones(2), shares)})
    show(addon, learned, weights, np.moveaxis(weights[0], 0, -1) @ CAN, objects=("can",))
    addon.palettes.import_learned(learned)
    addon.displayed.forget(learned)
    addon.displayed.of(learned).refresh()
    return learned.karf.objects["can"]


def test_added_color_has_the_given_or_default_protection(bpy, addon, learned, can):
    picked, default = tuple(LETTERS @ CAN), pytest.approx(addon.engine_api.PROTECT)
    number = addon.steps.add_color(learned, "can", picked, reach=2.0, protect=0.0)
    bpy.ops.karf.solo_swatch(object_name="can", index=number)
    assert halves(addon, learned)[:, 0].min() > 0.5  # its hue is all that counts
    can.swatches[number].protect = addon.engine_api.PROTECT
    letters, silver = halves(addon, learned)[:, 0]
    bpy.context.window_manager.karf_seeing.mode = "EDITED"
    assert letters > 0.8 and silver < 0.01
    assert can.swatches[addon.steps.add_color(learned, "can", picked)].protect == default
    given = addon.steps.add_color(learned, "can", picked, reach=0.5, protect=0.0)
    assert (can.swatches[given].reach, can.swatches[given].protect) == (0.5, 0)
