"""Coarse masks on disk: what is found, and one clear error for each way to get them wrong."""

import os
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("scipy")
pytest.importorskip("imageio")

from blender_tests.engine.reference.no_files import NO_FILES
from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import Capture, View
from karf_engine.capture.reader_utils import make_views
from karf_engine.capture.training_images import TrainingImage
from karf_engine.errors import DataError
from karf_engine.io.images import write_png
from karf_engine.segmentation.coarse_masks import copy_masks, find_masks, load_mask, marked_views
from karf_engine.segmentation.corrections import find_corrections

MASK = np.zeros((12, 18), bool)
MASK[2:8, 4:12] = True
COMPOSED, DECOMPOSED = "caf\u00e9", "cafe\u0301"


@pytest.fixture
def capture(tmp_path):
    camera = Camera(18, 12, 20.0, 20.0, 9.0, 6.0, np.eye(4))
    names = [("a", "a", "train"), ("train_r_0", "r_0", "train"), ("test_r_0", "r_0", "test"), ("held", "held", "test")]
    return Capture(tmp_path, "test", tuple(View(name, stem, camera, None, split) for name, stem, split in names))


def plate_of(view, width=18, height=12):
    return TrainingImage(view, view.camera.scaled(width, height), np.zeros((height, width, 3)), None, None)


def error_of(action, *arguments):
    with pytest.raises(DataError) as caught:
        action(*arguments)
    assert caught.value.hint
    return caught.value.sentence


def test_masks_are_found_by_stem_or_view_name_sorted_by_object(tmp_path, capture):
    for name in ("pot/a", "pot/r_0", "lid/train_r_0"):
        write_png(tmp_path / f"{name}.png", MASK)
    write_png(tmp_path / ".hidden" / "a.png", MASK)
    (tmp_path / "pot" / "._a.png").write_bytes(b"left by another system")
    (tmp_path / "pot" / "notes.txt").write_text("not a mask")
    found = [(mask.object_name, mask.view.name) for mask in find_masks(tmp_path, capture)]
    assert found == [("lid", "train_r_0"), ("pot", "a"), ("pot", "train_r_0")]


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ([], "holds no masks"),
        (["pot/notes.txt"], "holds no mask of the object 'pot'"),
        (["pot/nobody.png"], "nobody.png is named after no photo"),
        (["Background/a.png"], "names an object 'background'"),
    ],
)
def test_folders_that_do_not_fit_the_capture_are_named(tmp_path, capture, files, words):
    folder = tmp_path / "masks"
    folder.mkdir()
    for name in files:
        write_png(folder / name, MASK)
    sentence = error_of(find_masks, folder, capture)
    assert words in sentence and str(folder) in sentence


def test_held_out_photos_may_be_marked_and_a_stem_means_the_training_photo(tmp_path, capture):
    for name in ("held", "test_r_0", "r_0"):
        write_png(tmp_path / "pot" / f"{name}.png", MASK)
    assert [mask.view.name for mask in find_masks(tmp_path, capture)] == ["held", "train_r_0", "test_r_0"]
    assert marked_views(tmp_path, capture) == {"held", "train_r_0", "test_r_0"}
    assert marked_views(tmp_path / "nowhere", capture) == set()


def test_a_missing_folder_and_a_file_in_its_place_are_named(tmp_path, capture):
    (tmp_path / "file").write_text("")
    for name in ("nowhere", "file"):
        sentence = error_of(find_masks, tmp_path / name, capture)
        assert sentence == f"{tmp_path / name} is not a folder of masks."


def test_masks_of_another_size_are_named_with_both_sizes(tmp_path, capture):
    write_png(tmp_path / "pot" / "a.png", np.ones((12, 17), bool))
    (mask,) = find_masks(tmp_path, capture)
    sentence = error_of(load_mask, mask, plate_of(mask.view))
    assert sentence == f"{mask.path} is 17x12 pixels where its photo has 18x12."


def test_empty_and_unreadable_masks_are_named(tmp_path, capture):
    write_png(tmp_path / "pot" / "a.png", np.zeros((12, 18), bool))
    (mask,) = find_masks(tmp_path, capture)
    assert error_of(load_mask, mask, plate_of(mask.view)) == f"{mask.path} marks nothing of 'pot'."
    mask.path.write_bytes(b"not a picture")
    assert str(mask.path) in error_of(load_mask, mask, plate_of(mask.view))


def test_masks_at_the_photos_or_the_working_size_both_fit(tmp_path, capture):
    write_png(tmp_path / "pot" / "a.png", MASK)
    write_png(tmp_path / "pot" / "r_0.png", MASK[::2, ::2])
    large, small = find_masks(tmp_path, capture)
    for mask in (large, small):
        assert np.array_equal(load_mask(mask, plate_of(mask.view, 9, 6)), MASK[::2, ::2])
    assert np.array_equal(load_mask(large, plate_of(large.view)), MASK)


def test_masks_are_painted_on_the_photo_so_its_lens_bends_them_too(tmp_path, capture):
    view = capture.views[0]
    bent = replace(view, camera=replace(view.camera, distortion=(-0.9, 0.0, 0.0, 0.0)))
    write_png(tmp_path / "pot" / "a.png", MASK)
    (mask,) = find_masks(tmp_path, replace(capture, views=(bent,)))
    plain = replace(bent, camera=replace(bent.camera, distortion=()))
    found = load_mask(mask, plate_of(plain))
    # a barrel lens shows things smaller than they are
    assert found.sum() > MASK.sum() and not np.array_equal(found, MASK)


def test_copied_masks_lie_under_their_views_names(tmp_path, capture):
    write_png(tmp_path / "given" / "pot" / "r_0.png", MASK)
    copy_masks(find_masks(tmp_path / "given", capture), tmp_path / "copies")
    again = find_masks(tmp_path / "copies", capture)
    assert [(m.object_name, m.view.name, m.path.name) for m in again] == [("pot", "train_r_0", "train_r_0.png")]
    assert np.array_equal(load_mask(again[0], plate_of(again[0].view)), MASK)


# -------------------------------------------------------------------------------------------------------- several cameras
@pytest.fixture
def rig(tmp_path):
    """A capture whose photos lie in one subfolder a camera, by the same names."""
    camera = Camera(18, 12, 20.0, 20.0, 9.0, 6.0, np.eye(4))
    photos = [tmp_path / "photos" / folder / f"000{n}.png" for folder in ("cam1", "cam2") for n in (1, 2)]
    return Capture(tmp_path, "test", tuple(make_views([camera] * 4, photos, [p.stem for p in photos], ["train"] * 4)))


def test_masks_may_lie_in_the_subfolders_of_the_photos(tmp_path, rig):
    for name in ("pot/cam1/0001", "pot/cam2/0001", "lid/cam2/0002"):
        write_png(tmp_path / "masks" / f"{name}.png", MASK)
    found = find_masks(tmp_path / "masks", rig)
    marked = [(mask.object_name, mask.view.image.relative_to(tmp_path / "photos").as_posix()) for mask in found]
    assert marked == [("lid", "cam2/0002.png"), ("pot", "cam1/0001.png"), ("pot", "cam2/0001.png")]
    copy_masks(found, tmp_path / "kept")  # under the views' names, which are found again
    assert [m.view for m in find_masks(tmp_path / "kept", rig)] == [m.view for m in found]


def test_a_mask_that_could_mean_photos_of_two_cameras_is_not_guessed(tmp_path, rig):
    write_png(tmp_path / "masks" / "pot" / "0001.png", MASK)
    assert "fits 2 photos, the views train_0001, train_0001_2" in error_of(find_masks, tmp_path / "masks", rig)


def test_masks_in_subfolders_of_no_photo_are_named(tmp_path, rig):
    write_png(tmp_path / "masks" / "pot" / "cam3" / "0001.png", MASK)
    assert "named after no photo" in error_of(find_masks, tmp_path / "masks", rig)


@pytest.mark.parametrize("make", [*NO_FILES[1:], lambda path: path.symlink_to(path)])
def test_what_is_no_file_in_place_of_a_mask_is_named_and_never_waited_for(tmp_path, capture, make):
    (tmp_path / "pot").mkdir()
    make(tmp_path / "pot" / "a.png")
    assert str(tmp_path / "pot" / "a.png") in error_of(find_masks, tmp_path, capture)


def test_two_objects_that_differ_by_case_alone_are_named(tmp_path, capture):
    for name in ("pot", "Pot"):
        write_png(tmp_path / "masks" / name / "a.png", MASK)
    assert "two objects 'Pot' and 'pot', one folder on Windows" in error_of(find_masks, tmp_path / "masks", capture)


def test_two_folders_of_one_word_in_two_unicode_forms_are_named(tmp_path, capture):
    for name in (COMPOSED, DECOMPOSED):
        write_png(tmp_path / "masks" / name / "a.png", MASK)
    assert "names two objects" in error_of(find_masks, tmp_path / "masks", capture)


def test_masks_and_corrections_in_two_unicode_forms_are_of_one_object(tmp_path, capture):
    for folder, name in (("masks", COMPOSED), ("corrections", DECOMPOSED)):
        write_png(tmp_path / folder / name / "a.png", MASK)
    marks = find_masks(tmp_path / "masks", capture) + find_corrections(tmp_path / "corrections", capture)
    assert {mark.object_name for mark in marks} == {COMPOSED}


@pytest.mark.parametrize("name", ["CON", "a:b", "pot.", "po\nt", os.fsdecode(b"p\xffot")])
def test_objects_whose_names_cannot_be_files_everywhere_are_named(tmp_path, capture, name):
    write_png(tmp_path / "masks" / name / "a.png", MASK)
    assert "names an object as no file can be called" in error_of(find_masks, tmp_path / "masks", capture)


def test_photos_of_names_that_are_no_text_are_found_by_their_masks(tmp_path):
    name = os.fsdecode(b"r_\xff1")
    views = make_views([Camera(18, 12, 20.0, 20.0, 9.0, 6.0, np.eye(4))], [tmp_path / f"{name}.png"], [name], ["train"])
    write_png(tmp_path / "masks" / "pot" / f"{name}.png", MASK)
    (mask,) = find_masks(tmp_path / "masks", Capture(tmp_path, "test", tuple(views)))
    copy_masks([mask], tmp_path / "kept")
    assert [path.name for path in (tmp_path / "kept" / "pot").iterdir()] == ["r__1.png"]
