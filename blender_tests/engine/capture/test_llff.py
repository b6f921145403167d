"""poses_bounds.npy: axes, photos of any size, depth bounds, and NeX's columns."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from blender_tests.engine.reference.capture_files import centered, llff_table, put, put_photos, random_rig, write_llff
from karf_engine.capture import open_capture
from karf_engine.errors import DataError

NAMES = [f"IMG_{number}.png" for number in range(9)]


@pytest.fixture
def cameras():
    return [centered(camera) for camera in random_rig(3)]


def test_the_columns_are_down_right_back(tmp_path):
    #        down  right  back  position  (height, width, focal)
    block = [[0.0, 1.0, 0.0, 5.0, 6.0], [-1.0, 0.0, 0.0, 6.0, 8.0], [0.0, 0.0, 1.0, 7.0, 10.0]]
    np.save(tmp_path / "poses_bounds.npy", [[*np.ravel(block), 2.0, 30.0]])
    put_photos(tmp_path / "images", ["a.png"], (8, 6))
    view = open_capture(tmp_path).views[0]
    assert_allclose(view.camera.camera_to_world, [[1, 0, 0, 5], [0, 1, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]])
    assert (view.camera.width, view.camera.height, view.camera.fx, view.camera.cx, view.camera.cy) == (8, 6, 10, 4, 3)
    assert view.depth_bounds == (2, 30)


def test_all_views_are_learned_from(tmp_path, cameras):
    write_llff(tmp_path, cameras, NAMES)
    capture = open_capture(tmp_path)
    assert capture.format == "llff" and capture.warnings == ()
    assert capture.split("train") == capture.views


@pytest.mark.parametrize("chosen", ["poses_bounds.npy", "."])
def test_file_and_folder_are_the_same_capture(tmp_path, cameras, chosen):
    write_llff(tmp_path, cameras, NAMES)
    assert [view.image for view in open_capture(tmp_path / chosen).views] == [tmp_path / "images" / n for n in NAMES]


def test_the_largest_photos_that_are_complete_are_taken(tmp_path, cameras):
    write_llff(tmp_path, cameras, NAMES)
    (tmp_path / "images" / NAMES[4]).unlink()
    for folder, size in (("images_2", (40, 30)), ("images_4", (20, 15)), ("images_20x15", (20, 16))):
        put_photos(tmp_path / folder, NAMES, size)
    capture = open_capture(tmp_path)
    assert {view.image.parent.name for view in capture.views} == {"images_2"}


def test_intrinsics_follow_the_real_size_along_each_axis(tmp_path, cameras):
    write_llff(tmp_path, cameras, NAMES)
    first = cameras[0]
    put_photos(tmp_path / "images", NAMES, (2 * first.width, 3 * first.height))
    capture = open_capture(tmp_path)
    camera = capture.views[0].camera
    assert_allclose([camera.fx, camera.fy], [2 * first.fx, 3 * first.fx])
    assert_allclose([camera.cx, camera.cy], [first.width, 1.5 * first.height])
    assert "scaled" in capture.warnings[0]


def test_counts_that_do_not_match_are_both_named(tmp_path, cameras):
    write_llff(tmp_path, cameras, NAMES)
    put_photos(tmp_path / "images", ["more.png"])
    with pytest.raises(DataError, match="9 poses, but images has 10 photos"):
        open_capture(tmp_path)


def test_hidden_and_other_files_are_no_photos(tmp_path, cameras):
    write_llff(tmp_path, cameras, NAMES)
    put(tmp_path / "images" / "._IMG_0.png", b"resource fork")
    put(tmp_path / "images" / "notes.txt", b"text")
    assert len(open_capture(tmp_path).views) == 9


def test_nex_poses_have_their_lens_in_a_second_file(tmp_path):
    cameras = random_rig(5)
    write_llff(tmp_path, cameras, NAMES, columns=14)
    read = open_capture(tmp_path).views[2].camera
    assert_allclose(
        [read.fx, read.fy, read.cx, read.cy], [getattr(cameras[2], key) for key in ("fx", "fy", "cx", "cy")]
    )
    assert_allclose(read.camera_to_world, cameras[2].camera_to_world, atol=1e-9)
    (tmp_path / "hwf_cxcy.npy").unlink()
    with pytest.raises(DataError, match="14 columns"):
        open_capture(tmp_path)


def test_bare_cameras_are_named_by_their_row(tmp_path, cameras):
    np.save(tmp_path / "poses_bounds.npy", llff_table(cameras))
    views = open_capture(tmp_path, photos=False).views
    assert [view.name for view in views] == [f"{number:03d}" for number in range(9)]
    assert all(view.image is None for view in views)


def test_impossible_depth_bounds_are_left_out_with_a_remark(tmp_path, cameras):
    write_llff(tmp_path, cameras, NAMES)
    np.save(tmp_path / "poses_bounds.npy", llff_table(cameras, bounds=(-1.0, 5.0)))
    capture = open_capture(tmp_path)
    assert all(view.depth_bounds is None for view in capture.views)
    assert capture.warnings == ("9 views: depth bounds that are not a range of positive depths were left out.",)
