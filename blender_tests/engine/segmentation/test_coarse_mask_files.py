"""Masks of any kind of file, against shapes drawn by hand; and resizing, against hand arithmetic."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

pytest.importorskip("cv2")
pytest.importorskip("imageio.v3")
pytest.importorskip("OpenEXR")

from karf_engine.io.images import read_mask, resize, write_png

# ---------------------------------------------------------------------------------------------------------------- masks
SHAPE = np.array([[True, False, False], [True, True, False]])


def rgba(color, alpha):
    return np.dstack([np.broadcast_to(color, (2, 3)).astype(np.uint8)] * 3 + [np.broadcast_to(alpha, (2, 3))])


@pytest.mark.parametrize(
    "pixels",
    [
        SHAPE,
        SHAPE * np.uint8(255),
        np.where(SHAPE, 128, 127).astype(np.uint8),
        SHAPE.astype(np.uint8),
        SHAPE * np.uint16(40000),
        np.dstack([SHAPE * np.uint8(255), np.zeros((2, 3, 2), np.uint8)]),
        rgba(255, np.uint8(SHAPE * 255)),
        rgba(0, np.uint8(SHAPE * 255)),
        rgba([[9, 99, 200], [200, 9, 9]], np.uint8(SHAPE * 255)),
        rgba(SHAPE * 255, np.uint8(255)),
    ],
    ids=["bool", "gray", "half", "labels", "16-bit", "red", "white matte", "black matte", "cut-out", "opaque"],
)
def test_masks_of_any_kind_give_the_same_shape(tmp_path, pixels):
    write_png(tmp_path / "m.png", pixels)
    assert_array_equal(read_mask(tmp_path / "m.png"), SHAPE)


@pytest.mark.parametrize(
    ("pixels", "inside"),
    [
        (rgba(0, np.uint8(255)), False),
        (rgba(255, np.uint8(0)), False),
        (rgba(255, np.uint8(255)), True),
        (np.zeros((2, 3), np.uint8), False),
        (np.full((2, 3), 255, np.uint8), True),
    ],
)
def test_masks_without_a_border_are_all_or_nothing(tmp_path, pixels, inside):
    write_png(tmp_path / "m.png", pixels)
    assert_array_equal(read_mask(tmp_path / "m.png"), np.full((2, 3), inside))


# ------------------------------------------------------------------------------------------------------------- resizing
def test_shrinking_averages_areas_also_at_broken_factors():
    row = np.array([[0.0, 3.0, 6.0]])  # three pixels to two: 1 + 1/2 pixels each
    assert_allclose(resize(row, 2, 1), [[(0 + 3 / 2) / 1.5, (3 / 2 + 6) / 1.5]])
    image = np.random.default_rng(1).random((6, 8, 3))
    assert_allclose(resize(image, 4, 2), image.reshape(2, 3, 4, 2, 3).mean((1, 3)), atol=1e-6)


def test_enlarging_interpolates_between_pixel_centers():
    assert_allclose(resize(np.array([[0.0, 1.0]]), 4, 2), [[0, 0.25, 0.75, 1.0]] * 2)


def test_resizing_to_the_same_size_changes_nothing():
    image = np.random.default_rng(2).random((3, 5, 3)).astype(np.float32)
    assert_array_equal(resize(image, 5, 3), image)
