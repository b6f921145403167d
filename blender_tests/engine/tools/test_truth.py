"""What judges compare with: true recolors, as renderings show them."""

import imageio.v3 as iio
import numpy as np

from karf_engine.io.color import linear_to_srgb, srgb_to_linear
from karf_engine.io.files import write_json
from tools.metrics.truth import Truth


def test_recolors_of_a_matte_capture_lie_over_white_as_renderings_do(tmp_path):
    picture = np.zeros((1, 3, 4), np.uint8)
    picture[0] = [(255, 0, 0, 255), (255, 0, 0, 51), (0, 0, 0, 0)]
    folder = tmp_path / "recolor" / "red" / "test"
    folder.mkdir(parents=True)
    iio.imwrite(folder / "r_000.png", picture)
    write_json(tmp_path / "edits.json", {"edits": {"red": {}}})
    (tmp_path / "labels").mkdir()
    write_json(tmp_path / "labels" / "names.json", {})

    (recolored,) = Truth(tmp_path).recolored("red")

    np.testing.assert_allclose(recolored[0], [(1, 0, 0), (1, 0.8, 0.8), (1, 1, 1)])


def write_repaint(folder, before, after):
    """A capture whose one training photo is repainted; its object fills the photo."""
    for path, picture in {
        "train/r_000.png": before,
        "recolor/new/train/r_000.png": after,
        "coarse_masks/one/pot/r_000.png": np.ones(before.shape[:2]),
    }.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        iio.imwrite(folder / path, np.rint(255 * picture).astype(np.uint8))
    write_json(folder / "edits.json", {"edits": {"new": {"objects": ["pot"], "reference_view": "r_000"}}})
    write_json(folder / "labels" / "names.json", {"pot": 1})
    return Truth(folder)


RED, GREEN, BLUE, CREAM = np.array([(0.7, 0.1, 0.1), (0.1, 0.5, 0.2), (0.1, 0.2, 0.7), (0.8, 0.8, 0.6)])


def lit(*paints):
    """Stripes of paints, each from the shade to the light."""
    shades = np.linspace(0.3, 1, 12)[None, :, None]
    return np.concatenate([linear_to_srgb(shades * srgb_to_linear(paint)) for paint in paints], 0)


def test_each_paint_has_a_pair_and_the_most_frequent_one_comes_first(tmp_path):
    truth = write_repaint(tmp_path, lit(RED, CREAM, RED), lit(GREEN, BLUE, GREEN))
    (red, green), (cream, blue) = truth.paint_pairs("new", "pot")
    for color, paint in ((red, RED), (green, GREEN), (cream, CREAM), (blue, BLUE)):
        shade = srgb_to_linear(color) / srgb_to_linear(paint)
        np.testing.assert_allclose(shade, shade.mean(), rtol=0.06)  # in the lit half, of one paint alone
        assert shade.mean() > 0.65


def test_light_and_shade_of_one_paint_are_one_pair(tmp_path):
    truth = write_repaint(tmp_path, lit(RED, RED), lit(BLUE, BLUE))
    assert len(truth.paint_pairs("new", "pot")) == 1


def test_a_mask_beside_what_changes_still_has_a_pair(tmp_path):
    truth = write_repaint(tmp_path, lit(RED), lit(RED))
    ((before, after),) = truth.paint_pairs("new", "pot")
    np.testing.assert_array_equal(before, after)
    assert np.isfinite(truth.color_pair("new", "pot")).all()
