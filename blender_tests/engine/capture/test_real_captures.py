"""Captures from the wild, where a folder of them is at hand: see the fixture `scenes`."""

import numpy as np
import pytest

from karf_engine.capture import open_capture
from karf_engine.capture.sparse_points import reprojection_errors, summarize
from karf_engine.errors import DataError

SCALED = ("34 views: photos are 504x378 where the file says 4032x3024; their intrinsics were scaled.",)


@pytest.mark.parametrize(
    ("name", "splits", "size", "warnings"),
    [
        ("chair", (100, 25, 25), (400, 400), ()),
        ("rose", (96, 33, 32), (224, 224), ()),
        ("fruit", (70, 11, 0), (605, 806), ()),
        ("flower", (29, 5, 0), (504, 378), SCALED),
        ("bonsai", (127, 19, 0), (800, 533), ()),
    ],
)
def test_real_captures_open_complete(scenes, name, splits, size, warnings):
    capture = open_capture(scenes / name, holdout=8)
    assert tuple(len(capture.split(split)) for split in ("train", "test", "val")) == splits
    assert {(view.camera.width, view.camera.height) for view in capture.views} == {size}
    assert all(view.image.is_file() for view in capture.views)
    assert len({view.name for view in capture.views}) == len({view.image for view in capture.views}) == sum(splits)
    assert capture.warnings == warnings


def test_the_llff_capture_has_its_focal_length_and_depths(scenes):
    views = open_capture(scenes / "flower").views
    np.testing.assert_allclose(views[0].camera.fx, 3575.05861 * 504 / 4032)
    assert all(0 < view.depth_bounds[0] < view.depth_bounds[1] for view in views)


def test_the_points_of_the_colmap_capture_are_seen_where_its_cameras_say(scenes):
    """COLMAP's own mean reprojection error is 0.41 pixels."""
    capture = open_capture(scenes / "bonsai")
    assert (len(capture.points), len(capture.points.view)) == (26717, 140819)
    for number in range(0, len(capture.views), 24):
        observed, projected = reprojection_errors(capture, number)
        assert np.linalg.norm(observed - projected, axis=1).mean() < 1
        summary = summarize(observed, projected)
        assert summary.count > 100 and summary.median < 0.7 and summary.worst < 10


def test_the_distorted_capture_keeps_its_lens(scenes):
    camera = open_capture(scenes / "fruit").views[0].camera
    np.testing.assert_allclose(camera.distortion, [-0.0024249825, -0.0212579453, 0.0110194733, 0.0095780623], rtol=1e-7)
    np.testing.assert_allclose([camera.fx, camera.fy], [627.789292, 616.504586], rtol=1e-8)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("colmap_truncated_stitch", "images.bin is cut off at byte 2359296, within image 14 of 82"),
        ("lfs_pointers_fern", "poses_bounds.npy is a Git-LFS pointer"),
        ("png_utf8_mangled_lego", "r_0.png is damaged: it was copied as text"),
        ("ngp_missing_images_cattoy", "none of its 93 photos was found"),
    ],
)
def test_broken_captures_give_one_clear_error(scenes, name, words):
    with pytest.raises(DataError) as caught:
        open_capture(scenes / "broken" / name)
    assert words in caught.value.sentence and name in caught.value.sentence
    assert caught.value.hint


@pytest.mark.parametrize(("name", "kind"), [("chair", "alpha"), ("rose", "black"), ("fruit", "opaque")])
def test_real_photos_load_at_the_working_size(scenes, name, kind):
    pytest.importorskip("scipy")
    from karf_engine.capture.training_images import background_kind, load_views
    from karf_engine.io.images import read_photo

    views = open_capture(scenes / name).views[::20]
    training_images = load_views(views, 128)
    assert {max(training_image.color.shape) for training_image in training_images} == {128}
    assert all((training_image.alpha is not None) == (kind == "alpha") for training_image in training_images)
    assert all((training_image.valid is not None) == (name == "fruit") for training_image in training_images)
    assert background_kind([read_photo(view.image) for view in views]) == kind
