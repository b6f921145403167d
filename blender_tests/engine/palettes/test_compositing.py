"""Compositing of edit planes, all at once and swatch by swatch, and the files of planes."""

from dataclasses import replace

import numpy as np
import pytest

from karf_engine.errors import DataError
from karf_engine.palettes.compositing import (
    Planes,
    delta_composite,
    paper_composite,
    read_planes,
    stack_palettes,
    write_planes,
)
from karf_engine.palettes.swatch_picture import delta_picture, paper_picture

SIZE = (90, 250)
# successive edits: object, swatch, color (None: as learned)
EDITS = (
    [(0, 1, (0.9, 0.1, 1.7))],
    [(0, 1, (0.8, 0.1, 1.7))],
    [(1, 2, (0.0, 0.7, 0.1))],
    [(1, 2, (0.1, 0.7, 0.1)), (0, 3, (0.2, 0.2, 0.2))],
    [(1, 3, (1.0, 1.0, 1.0))],
    [(0, 1, None)],
    [(0, 3, None), (1, 2, None), (1, 3, None)],
)


@pytest.fixture
def planes():
    """Two objects that meet, of 4 palette entries each; the second does not use one of its entries."""
    random = np.random.default_rng(5)
    weights = random.dirichlet(np.ones(9), SIZE)[..., :8].transpose(2, 0, 1).reshape(2, 4, *SIZE).astype(np.float16)
    weights[0, :, :, :40] = weights[0, :, :, 170:] = weights[1, :, :20] = weights[1, :, 70:] = weights[1, 3] = 0
    base = random.integers(0, 256, (*SIZE, 3)).astype(np.uint8)
    return Planes(("pot", "tea cup é"), weights, weights.sum(axis=1), base)


@pytest.fixture
def learned():
    palettes = np.random.default_rng(6).random((2, 4, 3)).astype(np.float32)
    palettes[:, 0] = 0
    return palettes


def picture_of(planes):
    return planes.base.astype(np.float32) / np.float32(255)


def delta(planes, learned, edited, kind=np.float32):
    return delta_composite(picture_of(planes), planes.palette_weights.astype(kind), learned, edited)


def paper(planes, edited):
    weights, probabilities = planes.palette_weights.astype(np.float32), planes.probabilities.astype(np.float32)
    return paper_composite(picture_of(planes), weights, probabilities, edited)


@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_delta_adds_weighted_changes_to_the_base(planes, learned, kind):
    edited = learned.copy()
    edited[0, 2], edited[1, 3], edited[1, 2] = [1, 0.2, 0], [0, 0.9, 0.3], [0, 0.9, 0.3]
    weights = planes.palette_weights.astype(float)
    change = np.einsum("kjhw,kjc->hwc", weights, (edited - learned).astype(float))
    result = delta(planes, learned, edited, kind)
    assert result.dtype == np.float32
    np.testing.assert_allclose(result, np.clip(picture_of(planes) + change, 0, 1), atol=3e-7)
    elsewhere = (weights[0, 2] == 0) & (weights[1, 2] == 0)
    assert elsewhere.any()
    np.testing.assert_array_equal(result[elsewhere], picture_of(planes)[elsewhere])


def test_paper_composite_repaints_only_the_hard_mask():
    base = np.full((1, 4, 3), 0.5, np.float32)
    # pixels: background, object 0, object 1, object 0 against a stronger background
    probabilities = np.array([[[0, 0.8, 0.3, 0.4]], [[0, 0.1, 0.6, 0.0]]], np.float32)
    shares = np.array([[0.25, 0.75], [0.5, 0.5]], np.float32)
    weights = shares[:, :, None, None] * probabilities[:, None]
    edited = np.array([[[0, 0, 0], [0.8, 0.4, 0]], [[0, 0, 0], [0, 0, 1]]], np.float32)
    result = paper_composite(base, weights, probabilities, edited)
    np.testing.assert_allclose(result[0], [[0.5] * 3, [0.6, 0.3, 0], [0, 0, 0.5], [0.5] * 3], atol=1e-6)


def test_smaller_palettes_are_padded_with_zeros():
    stacked = stack_palettes(("b", "a"), {"a": np.ones((2, 3)), "b": np.full((3, 3), 0.5)})
    np.testing.assert_array_equal(stacked[:, :, 0], [[0.5, 0.5, 0.5], [1, 1, 0]])
    assert stack_palettes((), {}).shape == (0, 0, 3)


@pytest.mark.parametrize("compositing", ["delta", "paper"])
def test_successive_edits_match_the_engine(planes, learned, compositing):
    out = np.empty((*SIZE, 3), np.float32)
    picture = delta_picture(planes, out) if compositing == "delta" else paper_picture(planes, out)
    edited = learned.copy()
    for edit in ([], *EDITS):
        for k, j, color in edit:
            edited[k, j] = learned[k, j] if color is None else color
        shown = picture.paint(edited - learned if compositing == "delta" else edited)
        expected = delta(planes, learned, edited) if compositing == "delta" else paper(planes, edited)
        np.testing.assert_allclose(shown, expected, rtol=0, atol=1e-6)
    assert shown is out


def test_one_edited_swatch_matches_the_engine_bit_by_bit(planes, learned):
    picture = delta_picture(planes, np.empty((*SIZE, 3), np.float32))
    for color in (learned[0, 2], (0.1, 0.9, 0.2), (0.0, 0.4, 1.9), learned[0, 2]):
        edited = learned.copy()
        edited[0, 2] = color
        composed, shown = delta(planes, learned, edited), picture.paint(edited - learned)
        assert shown.tobytes() == composed.tobytes()
        assert (shown.tobytes() == picture_of(planes).tobytes()) == np.array_equal(edited, learned)


def test_alpha_of_an_rgba_buffer_stays(planes, learned):
    buffers = np.full((2, *SIZE, 4), 7, np.float32)
    weights = planes.palette_weights.astype(np.float32)
    delta_composite(picture_of(planes), weights, learned, 1 - learned, out=buffers[0, ..., :3])
    delta_picture(planes, buffers[1, ::-1, :, :3]).paint((1 - learned) - learned)
    for colors in (buffers[0, ..., :3], buffers[1, ::-1, :, :3]):
        np.testing.assert_allclose(colors, delta(planes, learned, 1 - learned), rtol=0, atol=1e-6)
    assert (buffers[..., 3] == 7).all()


@pytest.mark.parametrize(("n_objects", "n_entries"), [(0, 0), (2, 4)])
@pytest.mark.parametrize("make", [delta_picture, paper_picture, None])
def test_invisible_objects_change_nothing(make, n_objects, n_entries):
    nothing = np.zeros((n_objects, n_entries, 6, 5), np.float16)
    planes = Planes(("pot", "mug")[:n_objects], nothing, nothing.sum(1), np.full((6, 5, 3), 51, np.uint8))
    edited = np.ones((n_objects, n_entries, 3), np.float32)
    shown = make(planes, np.empty((6, 5, 3), np.float32)).paint(edited) if make else delta(planes, 0 * edited, edited)
    np.testing.assert_allclose(shown, 0.2, atol=1e-7)


def test_planes_and_gains_round_trip_bit_by_bit(tmp_path, planes):
    path = tmp_path / "planes" / "view.npz"
    for gains in ((1.0, 1.0, 1.0), (0.75, 1.0, 1.25)):
        write_planes(path, replace(planes, gains=gains))
        read = read_planes(path)
        assert (read.objects, read.gains) == (planes.objects, gains)
        assert ("gains" in np.load(path)) == (gains != (1.0, 1.0, 1.0))
        for name in ("palette_weights", "probabilities", "base"):
            assert getattr(read, name).dtype == getattr(planes, name).dtype
            np.testing.assert_array_equal(getattr(read, name), getattr(planes, name))
    assert list(path.parent.iterdir()) == [path]


def test_malformed_planes_are_rejected(tmp_path, planes):
    narrow = {"palette_weights": planes.palette_weights[..., :-1]}
    for change in (narrow, {"gains": (0.75, 1.0, 0.0)}, {"gains": (0.75, 1.0, np.nan)}):
        write_planes(tmp_path / "view.npz", replace(planes, **change))
        with pytest.raises(DataError, match="weights" if change is narrow else "gains"):
            read_planes(tmp_path / "view.npz")
