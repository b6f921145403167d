"""Coarse masks on disk: what is found and read, and one clear error for each way to get them wrong."""

import os
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from blender_tests.engine.reference.no_files import NO_FILES
from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import Capture, View
from karf_engine.capture.reader_utils import make_views
from karf_engine.capture.training_images import TrainingImage
from karf_engine.errors import DataError
from karf_engine.io.images import read_mask, resize, write_png
from karf_engine.segmentation.coarse_masks import copy_masks, find_masks, load_mask, marked_views
from karf_engine.segmentation.corrections import find_corrections

MASK = np.zeros((12, 18), bool)
MASK[2:8, 4:12] = True
CAMERA = Camera(18, 12, 20.0, 20.0, 9.0, 6.0, np.eye(4))
VIEWS = [("a", "a", "train"), ("train_r_0", "r_0", "train"), ("test_r_0", "r_0", "test"), ("held", "held", "test")]
COMPOSED, DECOMPOSED = "caf\u00e9", "cafe\u0301"


@pytest.fixture
def capture(tmp_path):
    return Capture(tmp_path, "test", tuple(View(name, stem, CAMERA, None, split) for name, stem, split in VIEWS))


@pytest.fixture
def draw(tmp_path):
    """Draw masks of these names, and return their folder."""

    def draw(*names, folder="masks", mask=MASK):
        (tmp_path / folder).mkdir(exist_ok=True)
        for name in names:
            write_png(tmp_path / folder / name, mask)
        return tmp_path / folder

    return draw


def plate_of(view, width=18, height=12):
    return TrainingImage(view, view.camera.scaled(width, height), np.zeros((height, width, 3)), None, None)


def names_of(masks):
    return [(mask.object_name, mask.view.name) for mask in masks]


def error_of(action, *arguments):
    with pytest.raises(DataError) as caught:
        action(*arguments)
    assert caught.value.hint
    return caught.value.sentence


SHAPE = np.array([[True, False, False], [True, True, False]])


def rgba(color, alpha):
    return np.dstack([np.broadcast_to(color, (2, 3)).astype(np.uint8)] * 3 + [np.broadcast_to(alpha, (2, 3))])


@pytest.mark.parametrize(
    ("pixels", "expected"),
    [
        (SHAPE, SHAPE),
        (SHAPE * np.uint8(255), SHAPE),
        (np.where(SHAPE, 128, 127).astype(np.uint8), SHAPE),
        (SHAPE.astype(np.uint8), SHAPE),  # labels
        (SHAPE * np.uint16(40000), SHAPE),
        (np.dstack([SHAPE * np.uint8(255), np.zeros((2, 3, 2), np.uint8)]), SHAPE),  # red
        (rgba(255, np.uint8(SHAPE * 255)), SHAPE),
        (rgba(0, np.uint8(SHAPE * 255)), SHAPE),
        (rgba([[9, 99, 200], [200, 9, 9]], np.uint8(SHAPE * 255)), SHAPE),  # a cut-out
        (rgba(SHAPE * 255, np.uint8(255)), SHAPE),
        (rgba(0, np.uint8(255)), False),
        (rgba(255, np.uint8(0)), False),
        (rgba(255, np.uint8(255)), True),
        (np.zeros((2, 3), np.uint8), False),
        (np.full((2, 3), 255, np.uint8), True),
    ],
)
def test_masks_of_any_kind_give_the_same_shape(tmp_path, pixels, expected):
    write_png(tmp_path / "m.png", pixels)
    assert_array_equal(read_mask(tmp_path / "m.png"), np.broadcast_to(expected, (2, 3)))


def test_pictures_shrink_by_the_mean_of_areas_and_grow_between_pixel_centers():
    row = np.array([[0.0, 3.0, 6.0]])  # three pixels to two: 1 + 1/2 pixels each
    assert_allclose(resize(row, 2, 1), [[(0 + 3 / 2) / 1.5, (3 / 2 + 6) / 1.5]])
    image = np.random.default_rng(1).random((6, 8, 3), np.float32)
    assert_allclose(resize(image, 4, 2), image.reshape(2, 3, 4, 2, 3).mean((1, 3)), atol=1e-6)
    assert_allclose(resize(np.array([[0.0, 1.0]]), 4, 2), [[0, 0.25, 0.75, 1.0]] * 2)
    assert_array_equal(resize(image, 8, 6), image)


def test_masks_of_the_photos_and_of_the_working_size_fit_and_its_lens_bends_them(capture, draw):
    draw("pot/a.png")
    large, small = find_masks(draw("pot/r_0.png", mask=MASK[::2, ::2]), capture)
    for mask in (large, small):
        assert_array_equal(load_mask(mask, plate_of(mask.view, 9, 6)), MASK[::2, ::2])
    assert_array_equal(load_mask(large, plate_of(large.view)), MASK)
    bent = replace(large, view=replace(large.view, camera=replace(CAMERA, distortion=(-0.9, 0.0, 0.0, 0.0))))
    found = load_mask(bent, plate_of(large.view))
    # a barrel lens shows things smaller than they are
    assert found.sum() > MASK.sum() and not np.array_equal(found, MASK)


def test_masks_that_do_not_fit_their_photo_mark_nothing_or_are_damaged_are_named(capture, draw):
    for pixels, sentence in [
        (np.ones((12, 17), bool), "{} is 17x12 pixels where its photo has 18x12."),
        (np.zeros((12, 18), bool), "{} marks nothing of 'pot'."),
    ]:
        (mask,) = find_masks(draw("pot/a.png", mask=pixels), capture)
        assert error_of(load_mask, mask, plate_of(mask.view)) == sentence.format(mask.path)
    mask.path.write_bytes(b"not a picture")
    assert str(mask.path) in error_of(load_mask, mask, plate_of(mask.view))


def test_masks_are_found_by_stem_or_view_name_sorted_by_object(capture, draw):
    folder = draw("pot/a.png", "pot/r_0.png", "lid/train_r_0.png", ".hidden/a.png")
    (folder / "pot" / "._a.png").write_bytes(b"left by another system")
    (folder / "pot" / "notes.txt").write_text("not a mask")
    assert names_of(find_masks(folder, capture)) == [("lid", "train_r_0"), ("pot", "a"), ("pot", "train_r_0")]


def test_held_out_photos_may_be_marked_and_a_stem_means_the_training_photo(tmp_path, capture, draw):
    folder = draw("pot/held.png", "pot/test_r_0.png", "pot/r_0.png")
    assert [mask.view.name for mask in find_masks(folder, capture)] == ["held", "train_r_0", "test_r_0"]
    assert marked_views(folder, capture) == {"held", "train_r_0", "test_r_0"}
    assert marked_views(tmp_path / "nowhere", capture) == set()
    for other in (tmp_path / "nowhere", folder / "pot" / "held.png"):
        assert error_of(find_masks, other, capture) == f"{other} is not a folder of masks."


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ([], "holds no masks"),
        (["pot/notes.txt"], "holds no mask of the object 'pot'"),
        (["pot/nobody.png"], "nobody.png is named after no photo"),
        (["Background/a.png"], "names an object 'background'"),
        (["pot/a.png", "Pot/a.png"], "two objects 'Pot' and 'pot', one folder on Windows"),
        ([f"{COMPOSED}/a.png", f"{DECOMPOSED}/a.png"], "names two objects"),
        *(
            ([f"{name}/a.png"], "names an object as no file can be called")
            for name in ("CON", "a:b", "pot.", "po\nt", os.fsdecode(b"p\xffot"))
        ),
    ],
)
def test_folders_that_do_not_fit_the_capture_are_named(capture, draw, files, words):
    folder = draw(*files)
    sentence = error_of(find_masks, folder, capture)
    assert words in sentence and str(folder) in sentence


@pytest.mark.parametrize("make", [*NO_FILES[1:], lambda path: path.symlink_to(path)])
def test_what_is_no_file_in_place_of_a_mask_is_named_and_never_waited_for(capture, draw, make):
    folder = draw()
    (folder / "pot").mkdir()
    make(folder / "pot" / "a.png")
    assert str(folder / "pot" / "a.png") in error_of(find_masks, folder, capture)


def test_copies_lie_under_their_views_names_and_objects_are_one_in_two_unicode_forms(tmp_path, capture, draw):
    found = find_masks(draw("pot/r_0.png", f"{COMPOSED}/a.png"), capture)
    copy_masks(found, tmp_path / "copies")
    cafe, pot = find_masks(tmp_path / "copies", capture)
    assert (*names_of([pot]), pot.path.name) == (("pot", "train_r_0"), "train_r_0.png")
    assert_array_equal(load_mask(pot, plate_of(pot.view)), MASK)
    (correction,) = find_corrections(draw(f"{DECOMPOSED}/a.png", folder="corrections"), capture)
    assert correction.object_name == cafe.object_name == COMPOSED


def test_photos_of_names_that_are_no_text_are_found_by_their_masks(tmp_path, draw):
    name = os.fsdecode(b"r_\xff1")
    views = make_views([CAMERA], [tmp_path / f"{name}.png"], [name], ["train"])
    (mask,) = find_masks(draw(f"pot/{name}.png"), Capture(tmp_path, "test", tuple(views)))
    copy_masks([mask], tmp_path / "kept")
    assert [path.name for path in (tmp_path / "kept" / "pot").iterdir()] == ["r__1.png"]


@pytest.fixture
def rig(tmp_path):
    """A capture whose photos lie in one subfolder a camera, by the same names."""
    photos = [tmp_path / "photos" / folder / f"000{n}.png" for folder in ("cam1", "cam2") for n in (1, 2)]
    return Capture(tmp_path, "test", tuple(make_views([CAMERA] * 4, photos, [p.stem for p in photos], ["train"] * 4)))


def test_masks_may_lie_in_the_subfolders_of_the_photos(tmp_path, rig, draw):
    found = find_masks(draw("pot/cam1/0001.png", "pot/cam2/0001.png", "lid/cam2/0002.png"), rig)
    marked = [(mask.object_name, mask.view.image.relative_to(tmp_path / "photos").as_posix()) for mask in found]
    assert marked == [("lid", "cam2/0002.png"), ("pot", "cam1/0001.png"), ("pot", "cam2/0001.png")]
    copy_masks(found, tmp_path / "kept")  # under the views' names, which are found again
    assert [m.view for m in find_masks(tmp_path / "kept", rig)] == [m.view for m in found]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("pot/0001.png", "fits 2 photos, the views train_0001, train_0001_2"),
        ("pot/cam3/0001.png", "named after no photo"),
    ],
)
def test_a_mask_that_could_mean_photos_of_two_cameras_or_of_none_is_not_guessed(rig, draw, name, words):
    assert words in error_of(find_masks, draw(name), rig)
