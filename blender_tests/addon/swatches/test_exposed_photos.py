"""A photo that is exposed otherwise: palettes and edits are of the mean exposure, the picture is of the photo's own."""

import numpy as np
import pytest

from karf_engine.palettes.compositing import Planes

from ..prepared import write_current_planes

RED, GRAY, BLUE = (0.8, 0.2, 0.1), (0.5, 0.5, 0.5), (0.1, 0.3, 0.9)
GAINS = 0.75, 1.0, 1.1
HEIGHT, WIDTH = 16, 24


def photograph(addon, scene, gains):
    """Let the active view be a red pot in the middle of a gray ground, exposed by these gains."""
    coverage = np.zeros((2, HEIGHT, WIDTH), np.float16)
    coverage[1, 4:12, 6:18] = 1
    weights = np.zeros((2, 3, HEIGHT, WIDTH), np.float16)
    weights[1, 1] = coverage[1]
    base = np.where(coverage[1][..., None] > 0, RED, GRAY) * gains
    planes = Planes(("lid", "pot"), weights, coverage, np.rint(255 * base).astype(np.uint8), gains)
    write_current_planes(addon, scene, planes)
    addon.displayed.forget(scene)
    reds = addon.engine_api.ColorHistogram(np.array([RED, np.multiply(RED, 0.6)]), np.ones(2), np.eye(3)[[1, 1]])
    addon.displayed.of(scene).learned_histogram = lambda name: reds


@pytest.fixture
def pots(addon, learned):
    """The scene with a photo that is a bit dark and cold."""
    photograph(addon, learned, GAINS)
    return learned


def picture(addon, scene):
    """The picture as it is edited, [H, W, 3]."""
    addon.displayed.of(scene).recolor()
    return addon.images.upright(addon.images.pixels(scene.karf.result))[..., :3].copy()


def pixel(addon, scene):
    """A pixel of the pot, of its picture."""
    return picture(addon, scene)[8, 12]


@pytest.mark.parametrize("compositing", ["delta", "paper"])
@pytest.mark.parametrize("choke", [0, -2])
def test_the_picture_is_that_of_a_photo_in_the_mean_exposure_exposed_by_its_gains(addon, learned, compositing, choke):
    learned.karf.compositing, pot = compositing, learned.karf.objects["pot"]
    addon.steps.set_swatch(learned, "pot", 1, BLUE)
    addon.steps.set_swatch(learned, "pot", 2, (0.2, 0.9, 0.3))
    pot.choke = choke
    pictures = []
    for gains in ((1.0, 1.0, 1.0), GAINS):
        photograph(addon, learned, gains)
        pictures.append(picture(addon, learned))
    np.testing.assert_allclose(pictures[1], pictures[0] * GAINS, atol=0.01)


def test_nothing_changes_without_an_edit(addon, pots):
    np.testing.assert_allclose(pixel(addon, pots), np.rint(255 * np.multiply(RED, GAINS)) / 255, atol=1e-6)


def test_a_source_is_picked_as_the_photo_shows_it_and_meant_in_the_mean_exposure(bpy, addon, pots):
    item = pots.karf.objects["pot"]
    item.source, item.target = np.multiply(RED, GAINS), BLUE
    np.testing.assert_allclose(addon.colors.becoming(item).source, RED, atol=1e-6)
    assert bpy.ops.karf.becomes(object_name="pot") == {"FINISHED"}
    np.testing.assert_allclose(item.swatches[1].color, BLUE, atol=0.02)
    np.testing.assert_allclose(pixel(addon, pots), np.multiply(BLUE, GAINS), atol=0.02)


def test_a_painted_picture_is_matched_in_the_mean_exposure(addon, pots, tmp_path):
    painted = np.full((HEIGHT, WIDTH, 3), np.multiply(GRAY, GAINS))
    painted[4:12, 6:18] = np.multiply(BLUE, GAINS)
    addon.images.write_png(tmp_path / "wanted.png", painted)
    addon.steps.match_picture(pots, tmp_path / "wanted.png")
    np.testing.assert_allclose(pots.karf.objects["pot"].swatches[1].color, BLUE, atol=0.02)
