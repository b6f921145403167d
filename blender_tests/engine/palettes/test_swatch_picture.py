"""The picture that follows swatches is that of the compositing, whatever was edited before, in whatever order."""

from __future__ import annotations

import numpy as np
import pytest

from karf_engine.palettes.compositing import Planes, delta_composite, paper_composite
from karf_engine.palettes.swatch_picture import SwatchPicture, delta_picture, paper_picture

SIZE = (90, 250)


@pytest.fixture
def planes() -> Planes:
    """Two objects of 4 palette entries that meet, the second with an entry that it does not use; round them nothing."""
    random = np.random.default_rng(5)
    weights = random.dirichlet(np.ones(9), SIZE)[..., :8].transpose(2, 0, 1).reshape(2, 4, *SIZE)
    weights[0, :, :, :40] = weights[0, :, :, 170:] = weights[1, :, :20] = weights[1, :, 70:] = weights[1, 3] = 0
    weights = weights.astype(np.float16)
    base = random.integers(0, 256, (*SIZE, 3)).astype(np.uint8)
    return Planes(("pot", "mug"), weights, weights.sum(axis=1), base)


@pytest.fixture
def learned() -> np.ndarray:
    palettes = np.random.default_rng(6).random((2, 4, 3)).astype(np.float32)
    palettes[:, 0] = 0
    return palettes


def engine_delta(planes: Planes, learned: np.ndarray, edited: np.ndarray) -> np.ndarray:
    return delta_composite(
        planes.base.astype(np.float32) / np.float32(255), planes.palette_weights.astype(np.float32), learned, edited
    )


def engine_paper(planes: Planes, edited: np.ndarray) -> np.ndarray:
    wide = (planes.palette_weights.astype(np.float32), planes.probabilities.astype(np.float32))
    return paper_composite(planes.base.astype(np.float32) / np.float32(255), *wide, edited)


# an edit after the other: object, swatch, color; None: as learned
EDITS = (
    [(0, 1, (0.9, 0.1, 1.7))],
    [(0, 1, (0.8, 0.1, 1.7))],
    [(1, 2, (0.0, 0.7, 0.1))],
    [(1, 2, (0.1, 0.7, 0.1)), (0, 3, (0.2, 0.2, 0.2))],
    [(1, 3, (1.0, 1.0, 1.0))],
    [(0, 1, None)],
    [(0, 3, None), (1, 2, None), (1, 3, None)],
)


@pytest.mark.parametrize("compositing", ["delta", "paper"])
def test_every_edit_in_a_row_gives_the_engines_picture(planes: Planes, learned: np.ndarray, compositing: str) -> None:
    out = np.empty((*SIZE, 3), np.float32)
    picture = delta_picture(planes, out) if compositing == "delta" else paper_picture(planes, out)
    edited = learned.copy()
    for edit in ([], *EDITS):
        for k, j, color in edit:
            edited[k, j] = learned[k, j] if color is None else color
        shown = picture.paint(edited - learned if compositing == "delta" else edited)
        expected = engine_delta(planes, learned, edited) if compositing == "delta" else engine_paper(planes, edited)
        np.testing.assert_allclose(shown, expected, rtol=0, atol=1e-6)
    assert shown is out


def test_one_edited_swatch_gives_the_engines_bits_and_none_the_photos(planes: Planes, learned: np.ndarray) -> None:
    picture = delta_picture(planes, np.empty((*SIZE, 3), np.float32))
    base = planes.base.astype(np.float32) / np.float32(255)
    assert picture.paint(np.zeros_like(learned)).tobytes() == base.tobytes()
    for color in ((0.1, 0.9, 0.2), (0.0, 0.4, 1.9)):
        edited = learned.copy()
        edited[0, 2] = color
        assert picture.paint(edited - learned).tobytes() == engine_delta(planes, learned, edited).tobytes()
    edited[1, 1] = 1
    picture.paint(edited - learned)
    assert picture.paint(np.zeros_like(learned)).tobytes() == base.tobytes()


def test_only_the_colors_of_an_rgba_buffer_are_written(planes: Planes, learned: np.ndarray) -> None:
    buffer = np.full((*SIZE, 4), 7, np.float32)
    picture = delta_picture(planes, buffer[::-1, :, :3])
    picture.paint((1 - learned) - learned)
    np.testing.assert_allclose(buffer[::-1, :, :3], engine_delta(planes, learned, 1 - learned), rtol=0, atol=1e-6)
    assert (buffer[..., 3] == 7).all()


@pytest.mark.parametrize("make", [delta_picture, paper_picture])
def test_an_object_that_the_view_does_not_show_changes_nothing(make, learned: np.ndarray) -> None:
    nothing = np.zeros((2, 4, 6, 5), np.float16)
    planes = Planes(("pot", "mug"), nothing, nothing[:, 0], np.full((6, 5, 3), 51, np.uint8))
    picture: SwatchPicture = make(planes, np.empty((6, 5, 3), np.float32))
    np.testing.assert_allclose(picture.paint(1 - learned), 0.2, atol=1e-7)


def test_no_objects_leave_the_base() -> None:
    planes = Planes(
        (), np.zeros((0, 0, 4, 3), np.float16), np.zeros((0, 4, 3), np.float16), np.ones((4, 3, 3), np.uint8)
    )
    for make in (delta_picture, paper_picture):
        picture = make(planes, np.empty((4, 3, 3), np.float32)).paint(np.zeros((0, 0, 3)))
        np.testing.assert_array_equal(picture, np.float32(1) / np.float32(255))
