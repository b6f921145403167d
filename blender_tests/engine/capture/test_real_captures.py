"""Real captures, where a folder of them is available (see the fixture `scenes`)."""

import numpy as np
import pytest

from karf_engine.capture import open_capture
from karf_engine.capture.sparse_points import reprojection_errors, summarize

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
def test_real_captures_open_completely(scenes, name, splits, size, warnings):
    capture = open_capture(scenes / name, holdout=8)
    assert tuple(len(capture.split(split)) for split in ("train", "test", "val")) == splits
    assert {(view.camera.width, view.camera.height) for view in capture.views} == {size}
    assert all(view.image.is_file() for view in capture.views)
    assert len({view.name for view in capture.views}) == len({view.image for view in capture.views}) == sum(splits)
    assert capture.warnings == warnings


def test_colmap_points_project_close_to_their_observations(scenes):
    """COLMAP's own mean reprojection error is 0.41 pixels."""
    capture = open_capture(scenes / "bonsai")
    assert (len(capture.points), len(capture.points.view)) == (26717, 140819)
    for number in range(0, len(capture.views), 24):
        observed, projected = reprojection_errors(capture, number)
        assert np.linalg.norm(observed - projected, axis=1).mean() < 1
        summary = summarize(observed, projected)
        assert summary.count > 100 and summary.median < 0.7 and summary.worst < 10
