"""Coarse masks on disk: finding, reading and copying them, and a clear error for each mistake."""

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
IMPOSSIBLE_NAMES = "CON", "a:b", "pot.", "po\nt", os.fsdecode(b"p\xffot")
SHAPE = np.array([[True, False, False], [True, True, False]])


@pytest.fixture
def capture(tmp_path):
    return Capture(tmp_path, "test", tuple(View(name, stem, CAMERA, None, split) for name, stem, split in VIEWS))


@pytest.fixture
def draw(tmp_path):
    """Draw masks at these paths and return their folder."""

    def draw(*names, folder="masks", mask=MASK):
        (tmp_path / folder).mkdir(exist_ok=True)
        for name in names:
            write_png(tmp_path / folder / name, mask)
        return tmp_path / folder

    return draw


def training_image(view, width=18, height=12):
    return TrainingImage(view, view.camera.scaled(width, height), np.zeros((height, width, 3)), None, None)


def names_of(masks):
    return [(mask.object_name, mask.view.name) for mask in masks]


def error_of(action, *arguments):
    with pytest.raises(DataError) as caught:
        action(*arguments)
    assert caught.value.hint
    return caught.value.sentence


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
def test_masks_of_every_pixel_kind_are_read_alike(tmp_path, pixels, expected):
    write_png(tmp_path / "m.png", pixels)
    assert_array_equal(read_mask(tmp_path / "m.png"), np.broadcast_to(expected, (2, 3)))


def test_resize_averages_areas_and_interpolates_between_centers():
    row = np.array([[0.0, 3.0, 6.0]])  # three pixels to two: 1 + 1/2 pixels each
    assert_allclose(resize(row, 2, 1), [[(0 + 3 / 2) / 1.5, (3 / 2 + 6) / 1.5]])
    image = np.random.default_rng(1).random((6, 8, 3), np.float32)
    assert_allclose(resize(image, 4, 2), image.reshape(2, 3, 4, 2, 3).mean((1, 3)), atol=1e-6)
    assert_allclose(resize(np.array([[0.0, 1.0]]), 4, 2), [[0, 0.25, 0.75, 1.0]] * 2)
    assert_array_equal(resize(image, 8, 6), image)


def test_masks_fit_in_full_and_working_size_and_are_undistorted(capture, draw):
    draw("pot/a.png")
    large, small = find_masks(draw("pot/r_0.png", mask=MASK[::2, ::2]), capture)
    for mask in (large, small):
        assert_array_equal(load_mask(mask, training_image(mask.view, 9, 6)), MASK[::2, ::2])
    assert_array_equal(load_mask(large, training_image(large.view)), MASK)
    bent = replace(large, view=replace(large.view, camera=replace(CAMERA, distortion=(-0.9, 0.0, 0.0, 0.0))))
    found = load_mask(bent, training_image(large.view))
    # a barrel lens shows things smaller than they are
    assert found.sum() > MASK.sum() and not np.array_equal(found, MASK)


def test_unfitting_empty_or_damaged_masks_are_rejected_by_path(capture, draw):
    (mask,) = find_masks(draw("pot/a.png", mask=np.ones((12, 17), bool)), capture)
    arguments = load_mask, mask, training_image(mask.view)
    assert error_of(*arguments) == f"{mask.path} is 17x12 pixels where its photo has 18x12."
    draw("pot/a.png", mask=np.zeros((12, 18), bool))
    assert error_of(*arguments) == f"{mask.path} marks nothing of 'pot'."
    mask.path.write_bytes(b"not a picture")
    assert str(mask.path) in error_of(*arguments)


def test_masks_are_found_by_stem_or_view_name_sorted_by_object(capture, draw):
    folder = draw("pot/a.png", "pot/r_0.png", "lid/train_r_0.png", ".hidden/a.png")
    (folder / "pot" / "._a.png").write_bytes(b"left by another system")
    (folder / "pot" / "notes.txt").write_text("not a mask")
    assert names_of(find_masks(folder, capture)) == [("lid", "train_r_0"), ("pot", "a"), ("pot", "train_r_0")]


def test_held_out_views_may_be_marked_and_stems_mean_training_views(tmp_path, capture, draw):
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
        *(([f"{name}/a.png"], "names an object as no file can be called") for name in IMPOSSIBLE_NAMES),
    ],
)
def test_folders_that_do_not_fit_the_capture_are_rejected_by_path(capture, draw, files, words):
    folder = draw(*files)
    sentence = error_of(find_masks, folder, capture)
    assert words in sentence and str(folder) in sentence


@pytest.mark.parametrize("make", [*NO_FILES[1:], lambda path: path.symlink_to(path)])
def test_non_files_in_place_of_masks_are_rejected_without_waiting(capture, draw, make):
    path = draw() / "pot" / "a.png"
    path.parent.mkdir()
    make(path)
    assert str(path) in error_of(find_masks, path.parents[1], capture)


def test_copies_use_view_names_and_unicode_forms_of_objects_match(tmp_path, capture, draw):
    found = find_masks(draw("pot/r_0.png", f"{COMPOSED}/a.png"), capture)
    copy_masks(found, tmp_path / "copies")
    cafe, pot = find_masks(tmp_path / "copies", capture)
    assert (*names_of([pot]), pot.path.name) == (("pot", "train_r_0"), "train_r_0.png")
    assert_array_equal(load_mask(pot, training_image(pot.view)), MASK)
    (correction,) = find_corrections(draw(f"{DECOMPOSED}/a.png", folder="corrections"), capture)
    assert correction.object_name == cafe.object_name == COMPOSED


def test_masks_of_photos_with_undecodable_names_are_found(tmp_path, draw):
    name = os.fsdecode(b"r_\xff1")
    views = make_views([CAMERA], [tmp_path / f"{name}.png"], [name], ["train"])
    (mask,) = find_masks(draw(f"pot/{name}.png"), Capture(tmp_path, "test", tuple(views)))
    copy_masks([mask], tmp_path / "kept")
    assert [path.name for path in (tmp_path / "kept" / "pot").iterdir()] == ["r__1.png"]


@pytest.fixture
def rig(tmp_path):
    """A capture with one subfolder of equally named photos per camera."""
    photos = [tmp_path / "photos" / folder / f"000{n}.png" for folder in ("cam1", "cam2") for n in (1, 2)]
    return Capture(tmp_path, "test", tuple(make_views([CAMERA] * 4, photos, [p.stem for p in photos], ["train"] * 4)))


def test_masks_may_lie_in_subfolders_like_their_photos(tmp_path, rig, draw):
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
def test_ambiguous_or_unknown_masks_of_a_rig_are_rejected(rig, draw, name, words):
    assert words in error_of(find_masks, draw(name), rig)
