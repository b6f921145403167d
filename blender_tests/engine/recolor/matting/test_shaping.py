"""Photos whose objects' edges were moved and faded."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("cv2")

from karf_engine.io.image_size import ImageHeader
from karf_engine.palettes.edge_planes import apply_edges_to_planes
from karf_engine.palettes.edge_shape import EdgeShape, apply_edge_shape
from karf_engine.palettes.palette import Edit, Palette
from karf_engine.recolor.full_resolution import PhotoView, dense_weights
from karf_engine.recolor.matting.matte import Matte, dense_coverage
from karf_engine.recolor.photos import StoredPhoto

POT = Palette("pot", np.array([[0, 0, 0], [0.9, 0.2, 0.1], [1, 0.9, 0.8]], np.float32))
MUG = Palette("mug", np.array([[0, 0, 0], [0.2, 0.3, 0.9]], np.float32))
GREEN = Edit(
    {"pot": POT.colors @ np.array([[0.3, 0.7, 0], [0.3, 0.6, 0], [0.3, 0, 0.7]], np.float32), "mug": MUG.colors}
)
HEIGHT, WIDTH = 40, 60


def view(kind=np.uint8, orientation=1):
    """A red pot on a gray wall, with a soft edge whose own color is known, and a mug beside it."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    coverage = np.clip((11 - np.hypot(rows - 18, columns - 25)) / 2 + 0.5, 0, 1)
    own, wall = np.array([200.0, 60, 40]), np.array([120.0, 125, 130])
    full = np.iinfo(kind).max / 255
    pixels = np.rint((coverage[..., None] * own + (1 - coverage[..., None]) * wall) * full).astype(kind)
    box = (6, 31), (13, 38)
    inner = coverage[slice(*box[0]), slice(*box[1])].astype(np.float16)
    mixed = np.flatnonzero((inner > 0) & (inner < 1))
    pot = Matte(*box, inner, mixed, np.tile(own.astype(np.uint8), (len(mixed), 1)))
    mug = Matte((10, 25), (40, 50), np.ones((15, 10), np.float16), np.zeros(0, int), np.zeros((0, 3), np.uint8))
    photo = StoredPhoto(Path("photo.png"), ImageHeader(WIDTH, HEIGHT, orientation, "png"), pixels)
    return PhotoView(photo, orientation, ["pot", "mug"], [pot, mug], [POT, MUG])


def shown(finished, edit):
    return finished.recolor(edit).colors()


def with_edge(choke=0.0, feather=0.0):
    return replace(GREEN, edges={"pot": EdgeShape(choke, feather)})


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_a_neutral_edge_leaves_every_bit(kind):
    finished = view(kind)
    np.testing.assert_array_equal(finished.recolor(with_edge()).pixels, finished.recolor(GREEN).pixels)


@pytest.mark.parametrize("shape", [(2, 0), (-2, 0), (0, 6), (-1.5, 4), (1, 3)])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_only_a_band_round_the_edge_changes(shape, kind):
    finished = view(kind)
    before, after = shown(finished, GREEN), shown(finished, with_edge(*shape))
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    away = np.abs(np.hypot(rows - 18, columns - 25) - 11)
    far = away > 1.5 + abs(shape[0]) + shape[1] / 2 + 1.5
    np.testing.assert_array_equal(after[far], before[far])
    assert np.abs(after - before)[away < 1.5].max() > 0.02


def test_the_picture_is_that_of_planes_of_the_same_size():
    finished = view()
    base = finished.photo.pixels
    coverages = dense_coverage(finished.mattes, base.shape[:2])
    weights = dense_weights([matte.own_picture(base) for matte in finished.mattes], [POT, MUG], coverages)
    for choke, feather in ((2, 0), (-2, 0), (0, 6), (-2, 5)):
        edit = with_edge(choke, feather)
        planes, _ = apply_edges_to_planes(base, weights, coverages, [POT, MUG], edit.edges, 1.0)
        change = np.einsum("mhw,mc->hwc", planes[0], edit.colors["pot"] - POT.colors)
        live = np.clip(base / 255 + change, 0, 1)
        assert np.abs(live - shown(finished, edit)).max() < 0.02


def test_a_smaller_result_scales_the_edge():
    half = replace(view(), scale=0.5)
    layers = half.layers(np.ones((2, 2)), edges={"pot": EdgeShape(choke=4)})
    before = dense_coverage(half.mattes, (HEIGHT, WIDTH))[0]
    np.testing.assert_allclose(layers.coverage[0], apply_edge_shape(before, EdgeShape(choke=2)), atol=1e-3)


@pytest.mark.parametrize("orientation", [1, 6])
def test_layers_recompose_the_picture(orientation):
    finished = view(orientation=orientation)
    edit = with_edge(-1.5, 4)
    layers = finished.layers(np.ones((2, 2)), edges=edit.edges)
    change = np.einsum("mhw,mc->hwc", layers.palette_weights[0].astype(float), edit.colors["pot"] - POT.colors)
    recomposed = np.clip(layers.base / 255 + change, 0, 1)
    assert np.abs(recomposed - finished.over_white(finished.recolor(edit))).max() < 0.01


def test_another_object_is_not_painted_however_far_it_grows():
    finished = view()
    before, after = (shown(finished, edit) for edit in (GREEN, with_edge(-12, 10)))
    np.testing.assert_array_equal(after[10:25, 40:50], before[10:25, 40:50])
    assert np.abs(after[18, 38] - before[18, 38]).max() > 0.01


def test_masks_stay_the_objects():
    finished = view()
    before = finished.masks()
    list(finished.recolor_all([with_edge(3, 5)]))
    np.testing.assert_array_equal(finished.masks(), before)


def test_edits_of_several_edges_come_in_their_order():
    finished = view()
    edits = [GREEN, with_edge(2), with_edge(2), GREEN, with_edge(feather=6)]
    for picture, edit in zip(finished.recolor_all(edits), edits, strict=True):
        np.testing.assert_array_equal(picture.pixels, finished.recolor(edit).pixels)
