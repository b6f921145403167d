"""poses_bounds.npy: axes, photos of any size, depth bounds, and NeX's columns."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from blender_tests.engine.reference.capture_files import centered, llff_table, put, put_photos, random_rig, write_llff
from karf_engine.capture import open_capture

NAMES = [f"IMG_{number}.png" for number in range(9)]
CAMERAS = [centered(camera) for camera in random_rig(3)]


@pytest.fixture
def folder(tmp_path):
    write_llff(tmp_path, CAMERAS, NAMES)
    return tmp_path


def test_the_columns_are_down_right_back(tmp_path):
    #        down  right  back  position  (height, width, focal)
    block = [[0.0, 1.0, 0.0, 5.0, 6.0], [-1.0, 0.0, 0.0, 6.0, 8.0], [0.0, 0.0, 1.0, 7.0, 10.0]]
    np.save(tmp_path / "poses_bounds.npy", [[*np.ravel(block), 2.0, 30.0]])
    put_photos(tmp_path / "images", ["a.png"], (8, 6))
    view = open_capture(tmp_path).views[0]
    assert_allclose(view.camera.camera_to_world, [[1, 0, 0, 5], [0, 1, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]])
    assert (view.camera.width, view.camera.height, view.camera.fx, view.camera.cx, view.camera.cy) == (8, 6, 10, 4, 3)
    assert view.depth_bounds == (2, 30)


@pytest.mark.parametrize("chosen", ["poses_bounds.npy", "."])
def test_all_views_are_learned_from_and_other_files_are_no_photos(folder, chosen):
    put(folder / "images" / "._IMG_0.png", b"resource fork")
    put(folder / "images" / "notes.txt", b"text")
    capture = open_capture(folder / chosen)
    assert capture.format == "llff" and capture.warnings == ()
    assert [view.image for view in capture.split("train")] == [folder / "images" / name for name in NAMES]


def test_the_largest_photos_that_are_complete_are_taken(folder):
    (folder / "images" / NAMES[4]).unlink()
    for name, size in (("images_2", (40, 30)), ("images_4", (20, 15)), ("images_20x15", (20, 16))):
        put_photos(folder / name, NAMES, size)
    assert {view.image.parent.name for view in open_capture(folder).views} == {"images_2"}


def test_impossible_depth_bounds_are_left_out_with_a_remark(folder):
    np.save(folder / "poses_bounds.npy", llff_table(CAMERAS, bounds=(-1.0, 5.0)))
    capture = open_capture(folder)
    assert all(view.depth_bounds is None for view in capture.views)
    assert capture.warnings == ("9 views: depth bounds that are not a range of positive depths were left out.",)
