"""Palettes extracted from the colors of known hulls, and of flat, noisy and stray pixels."""

import time

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from blender_tests.engine.palettes.conftest import LEGO
from karf_engine.errors import DataError
from karf_engine.palettes.color_histogram import cell_support, color_cells
from karf_engine.palettes.extraction import extract_palette
from karf_engine.palettes.palette_weights import outside_distance, star_weights


def mix(palette, n=60000, spread=0.4):
    return np.random.default_rng(0).dirichlet(np.full(len(palette), spread), n) @ palette


def rms_outside(cells, counts, palette):
    return float(np.sqrt(counts @ outside_distance(cells, palette) ** 2 / counts.sum()))


def is_palette(palette):
    return len(palette) >= 2 and palette.min() >= 0 and palette.max() <= 1 and not palette[0].any()


def test_cells_hold_the_mean_and_count_of_their_pixels():
    pixels = np.array([[0.01, 0, 0], [0.03, 0, 0], [1, 1, 1], [0.5, 0.5, 0.5]])
    cells, counts = color_cells(pixels, drop=0)
    # 0.01 and 0.03 share the first of 32 bins
    np.testing.assert_allclose(cells, [[0.02, 0, 0], [0.5, 0.5, 0.5], [1, 1, 1]])
    np.testing.assert_array_equal(counts, [2, 1, 1])


@pytest.mark.parametrize(("drop", "kept"), [(0.0005, [10, 9985]), (0.0015, [9985]), (0.00049, [5, 10, 9985])])
def test_rarest_cells_are_dropped_up_to_a_share(drop, kept):
    pixels = np.repeat(np.array([[0.9, 0, 0], [0, 0.9, 0], [0, 0, 0.9]]), [9985, 10, 5], axis=0)
    # 5 of 10000 pixels are 0.05 %, 15 would be more
    assert color_cells(pixels, drop=drop)[1].tolist() == kept


def test_known_hull_and_a_cut_corner_are_recovered():
    truth = np.array([[0, 0, 0], [0.9, 0.1, 0.1], [0.1, 0.8, 0.2], [0.2, 0.2, 0.9]])
    palette = extract_palette(*color_cells(mix(truth)))
    assert palette.shape == (4, 3) and palette.dtype == np.float32
    assert np.linalg.norm(palette[:, None] - truth, axis=2).min(axis=0).max() < 10 / 255  # cells are 8/255 wide
    # the collapse adds the least volume: nothing else moves
    whole = np.array([[0, 0, 0], [0.8, 0, 0], [0, 0.8, 0], [0, 0, 0.8]])
    cut = np.vstack([whole[:3], [[0.08, 0, 0.72], [0, 0.08, 0.72], [0, 0, 0.72]]])
    palette = extract_palette(cut, np.ones(len(cut)), 4)
    np.testing.assert_allclose(sorted(palette.tolist()), sorted(whole.tolist()), atol=1e-6)


@pytest.mark.parametrize("n_colors", [5, 6])
def test_collapse_keeps_nearly_all_colors_without_swelling(n_colors):
    cells, counts = color_cells(mix(LEGO))
    palette = extract_palette(cells, counts, n_colors)
    assert len(palette) <= n_colors and is_palette(palette)
    assert rms_outside(cells, counts, palette) < 0.5 / 255
    if n_colors == len(LEGO):
        assert ConvexHull(palette).volume < 1.02 * ConvexHull(LEGO).volume
    use = counts @ star_weights(cells, palette)
    assert (np.diff(use[1:]) <= 0).all()  # entries are sorted by use


def test_automatic_size_is_the_smallest_within_tolerance():
    cells, counts = color_cells(mix(LEGO))
    palette = extract_palette(cells, counts)
    fewer = extract_palette(cells, counts, len(palette) - 1)
    assert rms_outside(cells, counts, palette) <= 2 / 255 < rms_outside(cells, counts, fewer)
    assert len(extract_palette(cells, counts, tolerance=40 / 255)) < len(palette)


@pytest.mark.parametrize(
    ("pixels", "colors"),
    [
        (np.repeat(np.linspace(0, 1, 3000)[:, None], 3, axis=1), 2),
        (np.linspace(0.2, 1, 3000)[:, None] * [[0.8, 0.3, 0.1]], 2),
        (np.ones((50, 3)), 2),
        (np.full((50, 3), 0.004), 2),
        (np.zeros((50, 3)), 2),
        (np.array([[0.3, 0.6, 0.1]]), 2),
        (np.random.default_rng(2).random((3000, 2)) @ [[0.5, 0.1, 0.1], [0.1, 0.2, 0.5]], 4),
    ],
    ids=["grey ramp", "single hue", "white", "nearly black", "black", "one pixel", "planar"],
)
def test_flat_clouds_give_valid_palettes(pixels, colors):
    cells, counts = color_cells(pixels, drop=0)
    palette = extract_palette(cells, counts)
    assert is_palette(palette) and len(palette) == colors
    assert rms_outside(cells, counts, palette) < 1 / 255
    assert np.isfinite(star_weights(cells, palette)).all()
    # other sizes do not raise either
    assert is_palette(extract_palette(cells, counts, 6))
    assert len(extract_palette(cells, counts, 3)) <= 3


def test_noise_on_a_single_hue_adds_no_swatches():
    random = np.random.default_rng(3)
    pixels = random.random((60000, 1)) * [[0.8, 0.1, 0.1]] + random.normal(0, 2.5 / 255, (60000, 3))
    palette = extract_palette(*color_cells(np.clip(pixels, 0, 1)))
    assert len(palette) == 2
    np.testing.assert_allclose(palette[1], [0.8, 0.1, 0.1], atol=0.03)


def test_stray_pixels_and_spill_of_one_view_add_no_corner():
    pixels, cyan = mix(LEGO[:4], 40000), np.array([[0.05, 0.9, 0.9]])  # no other color is greener than red
    plain = extract_palette(*color_cells(pixels, drop=0))
    strays = color_cells(np.vstack([pixels, np.tile(cyan, (15, 1))]), drop=0)
    np.testing.assert_array_equal(extract_palette(*strays), plain)
    assert outside_distance(cyan, plain)[0] > 0.3
    views = [pixels, pixels, np.vstack([pixels, np.random.default_rng(4).normal(cyan, 0.02, (2000, 3))])]
    spilled = color_cells(np.vstack(views))
    support, unsupported = cell_support(spilled[0], views), extract_palette(*spilled)
    assert outside_distance(cyan, unsupported)[0] < 0.05
    assert outside_distance(cyan, extract_palette(*spilled, support=support))[0] > 0.3
    # with fewer than three views nothing is known about spill
    np.testing.assert_array_equal(extract_palette(*spilled, support=np.minimum(support, 2)), unsupported)


def test_extraction_of_4000_cells_takes_under_a_second():
    cells, counts = color_cells(np.clip(np.random.default_rng(5).normal(0.5, 0.1, (200000, 3)), 0, 1))
    assert len(cells) > 4000
    start = time.process_time()
    extract_palette(cells, counts)
    assert time.process_time() - start < 1


def test_empty_input_is_rejected():
    with pytest.raises(DataError, match="without pixels"):
        extract_palette(np.zeros((0, 3)), np.zeros(0))
