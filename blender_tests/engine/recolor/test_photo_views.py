"""Recolored photos keep their exposure and grain, and edges of their objects move and fade."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import View
from karf_engine.capture.training_images import TrainingImage
from karf_engine.fields.scene import Picture
from karf_engine.io.image_size import ImageHeader
from karf_engine.io.images import write_png
from karf_engine.palettes.edge_planes import apply_edges_to_planes
from karf_engine.palettes.edge_shape import EdgeShape, apply_edge_shape
from karf_engine.palettes.palette import Edit, Palette
from karf_engine.recolor import full_resolution
from karf_engine.recolor.frames import Frame
from karf_engine.recolor.full_resolution import PhotoView, denoise, dense_weights, estimate_noise, make_photo_view
from karf_engine.recolor.matting.matte import Matte, dense_coverage
from karf_engine.recolor.matting.thin_parts import Marks
from karf_engine.recolor.photos import StoredPhoto
from karf_engine.segmentation.views import MaskedViews

KINDS = pytest.mark.parametrize("kind", [np.uint8, np.uint16])
GAINS = 0.7, 1.0, 1.2
SIDE = 32
TEAL = Palette("pot", np.array([[0, 0, 0], [0.1, 0.6, 0.5], [0.75, 0.8, 0.7]], np.float32))
RUST = Edit({"pot": np.array([[0, 0, 0], [0.6, 0.25, 0.1], [0.8, 0.75, 0.7]], np.float32)})
# in the mean exposure: a pot of lit and dark paint and gloss in the left half, before a gray wall
POT = np.random.default_rng(0).dirichlet((1, 3, 1), (SIDE, SIDE)).astype(np.float32) @ TEAL.colors
POT[:, SIDE // 2 :] = 0.5

GRAIN = 2.0  # in 1/255
NAVY = Palette("jacket", np.array([[0, 0, 0], [0.12, 0.14, 0.3], [0.9, 0.9, 1]], np.float32))
ORANGE = Edit({"jacket": np.array([[0, 0, 0], [1.2, 0.5, 0.1], [1, 0.95, 0.9]], np.float32)})

RED_POT = Palette("pot", np.array([[0, 0, 0], [0.9, 0.2, 0.1], [1, 0.9, 0.8]], np.float32))
MUG = Palette("mug", np.array([[0, 0, 0], [0.2, 0.3, 0.9]], np.float32))
TO_GREEN = np.array([[0.3, 0.7, 0], [0.3, 0.6, 0], [0.3, 0, 0.7]], np.float32)
GREEN = Edit({"pot": RED_POT.colors @ TO_GREEN, "mug": MUG.colors})
HEIGHT, WIDTH = 40, 60
RADIUS = np.hypot(*(np.mgrid[:HEIGHT, :WIDTH] - np.array([18, 25])[:, None, None]))  # from the middle of the pot


def store_photo(picture, kind, orientation=1):
    """A stored photo of a picture, sRGB [H, W, 3]."""
    pixels = np.rint(np.clip(picture, 0, 1) * np.iinfo(kind).max).astype(kind)
    return StoredPhoto(Path("photo.png"), ImageHeader(pixels.shape[1], len(pixels), orientation, "png"), pixels)


def matte(rows, columns, coverage=1.0, color=(0, 0, 0)):
    """Coverage of a box of the photo; partly covered pixels belong to an object of this color."""
    inside = np.broadcast_to(np.float16(coverage), (rows[1] - rows[0], columns[1] - columns[0])).copy()
    mixed = np.flatnonzero((inside > 0) & (inside < 1))
    return Matte(rows, columns, inside, mixed, np.tile(np.uint8(color), (len(mixed), 1)))


def test_edit_without_change_keeps_every_bit():
    for view, palette in ((grainy_view(np.uint8), NAVY), (exposed_view(POT * GAINS, GAINS, np.uint8), TEAL)):
        same = view.recolor(Edit({palette.name: palette.colors}))
        np.testing.assert_array_equal(same.pixels, view.photo.pixels)


def exposed_view(picture, gains, kind):
    return PhotoView(store_photo(picture, kind), 1, ["pot"], [matte((0, SIDE), (0, SIDE // 2))], [TEAL], gains=gains)


def test_rendered_color_is_exposed_like_the_photo(tmp_path):
    write_png(tmp_path / "v.png", np.full((8, 8, 3), 0.5))
    camera = Camera(8, 8, 8.0, 8.0, 4.0, 4.0, np.eye(4))
    view = View("v", "v", camera, tmp_path / "v.png", "train", gains=(1.2, 1.0, 0.8))
    color, seen = torch.full((8, 8, 3), 0.5), []
    picture = Picture(color, torch.ones(8, 8), torch.ones(8, 8), None)
    frame = Frame(picture, np.zeros((0, 8, 8), np.float32), None, color.numpy())

    def record(photo, probabilities, rendered, marks):
        seen.append(rendered[0, 0].tolist())
        return []

    assert make_photo_view(view, "photo", frame, Marks(None, ()), record, [], []).gains == view.gains
    assert seen == [[153, 128, 102]]


@pytest.mark.parametrize("compositing", ["delta", "paper"])
@pytest.mark.parametrize(("kind", "step"), [(np.uint8, 3 / 255), (np.uint16, 3e-4)])
def test_recolored_dark_photo_equals_the_darkened_recolor(kind, step, compositing):
    edit = replace(RUST, compositing=compositing)
    alike, darker = exposed_view(POT, (1.0, 1.0, 1.0), kind), exposed_view(POT * GAINS, GAINS, kind)
    expected = alike.over_white(alike.recolor(edit)) * GAINS
    np.testing.assert_allclose(darker.over_white(darker.recolor(edit)), np.clip(expected, 0, 1), atol=step)
    np.testing.assert_array_equal(darker.recolor(edit).pixels[:, SIDE // 2 :], darker.photo.pixels[:, SIDE // 2 :])
    without_gains = replace(darker, gains=(1.0, 1.0, 1.0))
    assert np.abs(without_gains.over_white(without_gains.recolor(edit)) - expected).max() > 0.05


def test_objects_learn_their_colors_in_the_mean_exposure():
    camera = Camera(SIDE, SIDE, 8.0, 8.0, 4.0, 4.0, np.eye(4))
    exposures = {"alike": (1.0, 1.0, 1.0), "darker": GAINS}
    views = [View(name, name, camera, Path("v.png"), "train", gains=gains) for name, gains in exposures.items()]
    images = [TrainingImage(view, camera, (POT * np.float32(view.gains)).clip(0, 1), None, None) for view in views]
    alike, darker = MaskedViews([], images, [{}, {}]).colors().reshape(2, -1, 3)
    np.testing.assert_array_equal(alike, POT.reshape(-1, 3))
    np.testing.assert_allclose(darker, alike, atol=1e-6)


def grainy_view(kind):
    """A navy jacket, lit from the left, with a sharp white button."""
    clean = np.linspace(1, 0.4, 64)[None, :, None] * NAVY.colors[1] * np.ones((64, 1, 1))
    clean[20:30, 20:30] = 0.85
    photo = store_photo(clean + np.random.default_rng(0).normal(0, GRAIN / 255, clean.shape), kind)
    mattes = [matte((0, 64), (0, 64))]
    return PhotoView(photo, 1, ["jacket"], mattes, [NAVY], grain=estimate_noise(photo.over_white()))


def finest_details(picture):
    """The finest details of the cloth without the button, in 1/255."""
    cloth = picture[34:] * 255
    return ((cloth[1:, 1:] - cloth[:-1, 1:] - cloth[1:, :-1] + cloth[:-1, :-1]) / 2).std()


@KINDS
def test_brightened_paint_keeps_the_grain_and_stays_sharp(kind):
    view = grainy_view(kind)
    before = finest_details(view.over_white(view.photo))
    recolored = view.over_white(view.recolor(ORANGE))
    assert finest_details(view.over_white(replace(view, grain=0.0).recolor(ORANGE))) > 2 * before
    assert 0.7 * before < finest_details(recolored) < 1.3 * before
    assert recolored[25, 19].min() < 0.4 < 0.7 < recolored[25, 20].min()


def test_bands_of_rows_join_seamlessly(monkeypatch):
    view = grainy_view(np.uint8)
    whole = view.recolor(ORANGE).pixels
    monkeypatch.setattr(full_resolution, "BAND_PIXELS", 7 * 64)
    np.testing.assert_array_equal(view.recolor(ORANGE).pixels, whole)


def test_noise_estimate_ignores_texture():
    drawing = np.broadcast_to(np.where(np.arange(64) // 8 % 2, 200.0, 50.0)[None, :, None], (64, 64, 3))
    assert estimate_noise(drawing) == 0
    assert denoise(drawing, 0.0) is drawing
    grainy = drawing + np.random.default_rng(1).normal(0, GRAIN, drawing.shape)
    assert estimate_noise(grainy) == pytest.approx(GRAIN, rel=0.15)


def edged_view(kind=np.uint8, orientation=1):
    """A red pot on a gray wall, with a soft edge of known color, and a mug beside it."""
    coverage = np.clip((11 - RADIUS) / 2 + 0.5, 0, 1)
    own, wall = np.array([200.0, 60, 40]), np.array([120.0, 125, 130])
    picture = (coverage[..., None] * own + (1 - coverage[..., None]) * wall) / 255
    mattes = [matte((6, 31), (13, 38), coverage[6:31, 13:38], own), matte((10, 25), (40, 50))]
    return PhotoView(store_photo(picture, kind, orientation), orientation, ["pot", "mug"], mattes, [RED_POT, MUG])


def shape_edge(choke=0.0, feather=0.0):
    return replace(GREEN, edges={"pot": EdgeShape(choke, feather)})


@pytest.mark.parametrize("shape", [(2, 0), (-2, 0), (0, 6), (-1.5, 4), (1, 3), (-12, 10)])
@KINDS
def test_edge_shape_changes_only_a_band_around_the_edge(shape, kind):
    view = edged_view(kind)
    before, after = view.recolor(GREEN), view.recolor(shape_edge(*shape))
    np.testing.assert_array_equal(after.pixels[10:25, 40:50], before.pixels[10:25, 40:50])
    away = np.abs(RADIUS - 11)
    far = away > 1.5 + abs(shape[0]) + shape[1] / 2 + 1.5
    np.testing.assert_array_equal(after.colors()[far], before.colors()[far])
    assert np.abs(after.colors() - before.colors())[away < 1.5].max() > 0.02


@KINDS
def test_neutral_edge_shape_changes_nothing(kind):
    view = edged_view(kind)
    np.testing.assert_array_equal(view.recolor(shape_edge()).pixels, view.recolor(GREEN).pixels)


@pytest.mark.parametrize("shape", [(2, 0), (-2, 0), (0, 6), (-2, 5)])
@pytest.mark.parametrize("orientation", [1, 6])
def test_picture_matches_its_layers_and_planes(shape, orientation):
    view, edit = edged_view(orientation=orientation), shape_edge(*shape)
    moved, base = edit.colors["pot"] - RED_POT.colors, view.photo.pixels
    layers = view.layers(np.ones((2, 2)), edges=edit.edges)
    change = np.einsum("mhw,mc->hwc", layers.palette_weights[0].astype(float), moved)
    picture = view.recolor(edit)
    assert np.abs(np.clip(layers.base / 255 + change, 0, 1) - view.over_white(picture)).max() < 0.01
    coverages = dense_coverage(view.mattes, base.shape[:2])
    weights = dense_weights([each.own_picture(base) for each in view.mattes], [RED_POT, MUG], coverages)
    planes, _ = apply_edges_to_planes(base, weights, coverages, [RED_POT, MUG], edit.edges, 1.0)
    change = np.einsum("mhw,mc->hwc", planes[0], moved)
    assert np.abs(np.clip(base / 255 + change, 0, 1) - picture.colors()).max() < 0.02


def test_smaller_result_scales_the_edge():
    half = replace(edged_view(), scale=0.5)
    layers = half.layers(np.ones((2, 2)), edges={"pot": EdgeShape(choke=4)})
    before = dense_coverage(half.mattes, (HEIGHT, WIDTH))[0]
    np.testing.assert_allclose(layers.coverage[0], apply_edge_shape(before, EdgeShape(choke=2)), atol=1e-3)


def test_several_edges_recolor_in_order_and_keep_the_masks():
    view = edged_view()
    masks = view.masks()
    edits = [GREEN, shape_edge(2), shape_edge(2), GREEN, shape_edge(feather=6)]
    for picture, edit in zip(view.recolor_all(edits), edits, strict=True):
        np.testing.assert_array_equal(picture.pixels, view.recolor(edit).pixels)
    np.testing.assert_array_equal(view.masks(), masks)
