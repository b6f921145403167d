"""Photos that are exposed otherwise: their edges, and edits, which are those of the photos' mean exposure."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import View
from karf_engine.capture.training_images import TrainingImage
from karf_engine.fields.scene import Picture
from karf_engine.io.image_size import ImageHeader
from karf_engine.io.images import write_png
from karf_engine.palettes.palette import Edit, Palette
from karf_engine.recolor.frames import Frame
from karf_engine.recolor.full_resolution import PhotoView, dense_weights, make_photo_view
from karf_engine.recolor.matting.matte import Matte
from karf_engine.recolor.matting.thin_parts import Marks
from karf_engine.recolor.photos import StoredPhoto
from karf_engine.segmentation.views import MaskedViews

GAINS = 0.7, 1.0, 1.2
SIDE = 32
TEAL = Palette("pot", np.array([[0, 0, 0], [0.1, 0.6, 0.5], [0.75, 0.8, 0.7]], np.float32))
RUST = Edit({"pot": np.array([[0, 0, 0], [0.6, 0.25, 0.1], [0.8, 0.75, 0.7]], np.float32)})


def pot_in_mean_exposure():
    """A pot in the left half, of lit and dark paint and gloss, before a gray wall: [SIDE, SIDE, 3]."""
    shares = np.random.default_rng(0).dirichlet((1, 3, 1), (SIDE, SIDE)).astype(np.float32)
    picture = shares @ TEAL.colors
    picture[:, SIDE // 2 :] = 0.5
    return picture


def photo_view(picture, gains, kind):
    """The view of a photo, whose left half is covered by the pot."""
    full = np.iinfo(kind).max
    photo = StoredPhoto(
        Path("v.png"), ImageHeader(SIDE, SIDE, 1, "png"), np.rint(np.clip(picture, 0, 1) * full).astype(kind)
    )
    coverage = np.ones((SIDE, SIDE // 2), np.float16)
    matte = Matte((0, SIDE), (0, SIDE // 2), coverage, np.zeros(0, int), np.zeros((0, 3), np.uint8))
    return PhotoView(photo, 1, ["pot"], [matte], [TEAL], gains=gains)


def test_what_the_field_shows_is_exposed_as_the_photo(tmp_path):
    write_png(tmp_path / "v.png", np.full((8, 8, 3), 0.5))
    camera = Camera(8, 8, 8.0, 8.0, 4.0, 4.0, np.eye(4))
    view = View("v", "v", camera, tmp_path / "v.png", "train", gains=(1.2, 1.0, 0.8))
    color, seen = torch.full((8, 8, 3), 0.5), []
    picture = Picture(color, torch.ones(8, 8), torch.ones(8, 8), None)
    frame = Frame(picture, np.zeros((0, 8, 8), np.float32), None, color.numpy())

    def mattes_of(photo, probabilities, rendered, marks):
        seen.append(rendered[0, 0].tolist())
        return []

    finished = make_photo_view(view, "photo", frame, Marks(None, ()), mattes_of, [], [])
    assert seen == [[153, 128, 102]]
    assert finished.gains == view.gains


@pytest.mark.parametrize("compositing", ["delta", "paper"])
@pytest.mark.parametrize(("kind", "step"), [(np.uint8, 3 / 255), (np.uint16, 3e-4)])
def test_the_recolor_of_a_darker_photo_is_the_same_recolor_made_darker(kind, step, compositing):
    edit, picture = replace(RUST, compositing=compositing), pot_in_mean_exposure()
    alike = photo_view(picture, (1.0, 1.0, 1.0), kind)
    darker = photo_view(picture * GAINS, GAINS, kind)
    expected = alike.over_white(alike.recolor(edit)) * GAINS
    np.testing.assert_allclose(darker.over_white(darker.recolor(edit)), np.clip(expected, 0, 1), atol=step)
    as_if_alike = replace(darker, gains=(1.0, 1.0, 1.0))
    assert np.abs(as_if_alike.over_white(as_if_alike.recolor(edit)) - expected).max() > 0.05


def test_no_bit_changes_where_nothing_is_edited():
    view = photo_view(pot_in_mean_exposure() * GAINS, GAINS, np.uint8)
    np.testing.assert_array_equal(view.recolor(Edit({"pot": TEAL.colors})).pixels, view.photo.pixels)
    np.testing.assert_array_equal(view.recolor(RUST).pixels[:, SIDE // 2 :], view.photo.pixels[:, SIDE // 2 :])


def test_weights_are_those_of_the_mean_exposure():
    picture = pot_in_mean_exposure()
    alike, darker = (np.rint(255 * each).astype(np.uint8) for each in (picture, picture * GAINS))
    whole = np.ones((1, SIDE, SIDE), np.float32)
    expected = dense_weights([alike], [TEAL], whole)[..., : SIDE // 2]
    found = dense_weights([darker], [TEAL], whole, GAINS)[..., : SIDE // 2]
    np.testing.assert_allclose(found, expected, atol=0.03)
    assert np.abs(dense_weights([darker], [TEAL], whole)[..., : SIDE // 2] - expected).max() > 0.2


def test_objects_learn_their_colors_in_the_mean_exposure():
    picture = pot_in_mean_exposure()
    camera = Camera(SIDE, SIDE, 8.0, 8.0, 4.0, 4.0, np.eye(4))
    exposures = {"alike": (1.0, 1.0, 1.0), "darker": GAINS}
    views = [View(name, name, camera, Path("v.png"), "train", gains=gains) for name, gains in exposures.items()]
    images = [TrainingImage(view, camera, (picture * np.float32(view.gains)).clip(0, 1), None, None) for view in views]
    alike, darker = MaskedViews([], images, [{}, {}]).colors().reshape(2, -1, 3)
    np.testing.assert_array_equal(alike, picture.reshape(-1, 3))
    np.testing.assert_allclose(darker, alike, atol=1e-6)
