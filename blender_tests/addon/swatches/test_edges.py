"""Choked and feathered object edges, and photos exposed differently from the average."""

import json

import numpy as np
import pytest

from karf_engine.palettes.compositing import delta_composite, paper_composite, stack_palettes
from karf_engine.palettes.edge_planes import apply_edges_to_planes
from karf_engine.palettes.edge_shape import EdgeShape

from .scenes import BLUE, GRAY, GREEN, HEIGHT, RED, WIDTH, YELLOW, palettes, pixels, set_histogram, show_block

GAINS = 0.75, 1.0, 1.1


@pytest.fixture
def blue(addon, learned):
    """A pot that was made blue, in the middle of a gray picture."""
    show_block(addon, learned)
    addon.steps.set_swatch(learned, "pot", 1, BLUE)
    return learned.karf.objects["pot"]


def row(addon, pot):
    """The picture's middle row; the pot covers columns 6 to 17."""
    return pixels(addon, pot.id_data)[8]


def test_picture_follows_edges_and_colors(addon, learned, blue):
    before = pixels(addon, learned)
    blue.choke = 2
    np.testing.assert_allclose(row(addon, blue)[[6, 7, 16, 17]], [RED] * 4, atol=0.01)
    np.testing.assert_allclose(row(addon, blue)[[8, 15]], [BLUE] * 2, atol=0.02)
    blue.feather = 4
    assert len(np.unique(row(addon, blue)[:, 2].round(3))) > 3
    blue.choke, blue.feather = 0, 0
    np.testing.assert_array_equal(pixels(addon, learned), before)
    blue.choke = 1
    for color in (YELLOW, BLUE, GREEN):
        addon.steps.set_swatch(learned, "pot", 1, color)
        np.testing.assert_allclose(row(addon, blue)[[6, 12]], [RED, color], atol=0.02)
    blue.choke = -1  # the pot grows over its former edge
    np.testing.assert_allclose(row(addon, blue)[6], GREEN, atol=0.02)


@pytest.mark.parametrize("compositing", ["delta", "paper"])
def test_edges_match_the_engines_composite(addon, learned, blue, compositing):
    show_block(addon, learned, has_lid=True)  # the pot cannot grow into the lid
    learned.karf.compositing = compositing
    blue.choke, blue.feather = -1.5, 3
    planes, known = addon.displayed.of(learned).view.planes, addon.colors.palettes(learned)
    scale = max(HEIGHT, WIDTH) / max(addon.captures.view_of(learned).camera.width, 1)
    weights, probabilities = apply_edges_to_planes(
        planes.base, planes.palette_weights, planes.probabilities, known, {"pot": EdgeShape(-1.5, 3)}, scale
    )
    edited = stack_palettes(planes.objects, {item.name: addon.colors.edited(item) for item in learned.karf.objects})
    base = planes.base.astype(np.float32) / 255
    if compositing == "paper":
        expected = paper_composite(base, weights, probabilities, edited)
    else:
        stacked = stack_palettes(planes.objects, {palette.name: palette.colors for palette in known})
        expected = delta_composite(base, weights, stacked, edited)
    np.testing.assert_allclose(pixels(addon, learned), expected, atol=3e-3)  # the image has 8 bits


def test_added_color_keeps_its_pigment_up_to_the_new_edge(addon, learned, blue):
    number = addon.steps.add_color(learned, "pot", RED, YELLOW)
    blue.choke = 2
    np.testing.assert_allclose(row(addon, blue)[[7, 9]], [RED, YELLOW], atol=0.02)
    addon.steps.remove_color(learned, "pot", number)
    np.testing.assert_allclose(row(addon, blue)[[7, 9]], [RED, BLUE], atol=0.02)


def test_edit_files_without_edges_reset_them(addon, learned, blue, tmp_path):
    blue.choke, blue.feather, learned.karf.objects["lid"].choke = -1.5, 4, 3
    content = addon.edits.edit_option(learned)
    assert content["objects"]["pot"].pop("edges") == {"choke": -1.5, "feather": 4}
    assert content["objects"]["lid"].pop("edges") == {"choke": 3, "feather": 0}
    (tmp_path / "older.json").write_text(json.dumps(content))
    addon.steps.apply_edit(learned, tmp_path / "older.json")
    assert [(item.choke, item.feather) for item in learned.karf.objects] == [(0, 0), (0, 0)]


def test_other_tools_keep_edges(addon, learned, blue):
    blue.choke, blue.feather = 1.5, 4
    addon.steps.becomes(learned, "pot", RED, YELLOW)
    addon.edits.reset(learned, "pot")
    addon.palettes.load_palettes(learned, palettes(addon, pot=[GREEN, RED], new=[GREEN]))
    assert [(item.choke, item.feather) for item in learned.karf.objects] == [(1.5, 4), (0, 0)]


def test_edges_of_a_lost_object_are_kept_in_a_file(addon, learned):
    learned.karf.objects["lid"].feather = 3
    addon.palettes.load_palettes(learned, palettes(addon, pot=[RED, YELLOW]))
    (kept,) = (addon.folders.project_of(learned).folder / "edits").glob("kept-*.json")
    assert json.loads(kept.read_text())["objects"]["lid"]["edges"] == {"choke": 0.0, "feather": 3.0}


def test_frames_with_different_edges_get_separate_edits(addon, learned, blue, tmp_path):
    for frame in (1, 2):
        blue.choke = frame - 1
        blue.keyframe_insert("choke", frame=frame)
    _, files = addon.steps.render.write_sequence(learned, learned.camera, (1, 2), tmp_path)
    assert len(set(files)) == 2


@pytest.fixture
def dark(addon, learned):
    """The scene with a photo that is a little dark and cold."""
    show_block(addon, learned, GAINS)
    set_histogram(addon, learned, np.array([(0, 0, 0), RED, np.multiply(RED, 0.6)]), np.eye(3)[1:])
    return learned


@pytest.mark.parametrize("compositing", ["delta", "paper"])
@pytest.mark.parametrize("choke", [0, -2])
def test_exposure_gains_apply_after_recoloring_and_edges(addon, learned, compositing, choke):
    learned.karf.compositing, learned.karf.objects["pot"].choke = compositing, choke
    addon.steps.set_swatch(learned, "pot", 1, BLUE)
    addon.steps.set_swatch(learned, "pot", 2, GREEN)
    pictures = []
    for gains in ((1.0, 1.0, 1.0), GAINS):
        show_block(addon, learned, gains)
        pictures.append(pixels(addon, learned))
    np.testing.assert_allclose(pictures[1], pictures[0] * GAINS, atol=0.01)
    assert np.abs(pictures[1] - pictures[0]).max() > 0.1


def test_picked_source_is_converted_to_the_mean_exposure(bpy, addon, dark):
    item = dark.karf.objects["pot"]
    np.testing.assert_allclose(row(addon, item)[12], np.rint(255 * np.multiply(RED, GAINS)) / 255, atol=1e-6)
    item.source, item.target = np.multiply(RED, GAINS), BLUE
    np.testing.assert_allclose(addon.colors.becoming(item).source, RED, atol=1e-6)
    assert bpy.ops.karf.becomes(object_name="pot") == {"FINISHED"}
    np.testing.assert_allclose(item.swatches[1].color, BLUE, atol=0.02)
    np.testing.assert_allclose(row(addon, item)[12], np.multiply(BLUE, GAINS), atol=0.02)


def test_painted_picture_is_matched_in_the_mean_exposure(addon, dark, tmp_path):
    painted = np.full((HEIGHT, WIDTH, 3), np.multiply(GRAY, GAINS))
    painted[4:12, 6:18] = np.multiply(BLUE, GAINS)
    addon.images.write_png(tmp_path / "wanted.png", painted)
    addon.steps.match_picture(dark, tmp_path / "wanted.png")
    np.testing.assert_allclose(dark.karf.objects["pot"].swatches[1].color, BLUE, atol=0.02)
