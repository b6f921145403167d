"""A capture opens without its bad photos, which are counted and named."""

import json

import pytest

from blender_tests.engine.reference.capture_files import (
    put,
    put_json,
    random_rig,
    write_colmap,
    write_llff,
    write_transforms,
)
from karf_engine.capture import open_capture
from karf_engine.errors import DataError

NAMES = [f"{number}.png" for number in range(6)]
RIG = random_rig(5, 6)


@pytest.mark.parametrize("write", [write_transforms, write_llff, write_colmap])
@pytest.mark.parametrize("content", [b"", b"not a picture"])
def test_bad_photo_is_left_out(tmp_path, write, content):
    write(tmp_path, RIG, NAMES)
    put(tmp_path / "images" / "2.png", content)
    capture = open_capture(tmp_path)
    assert len(capture.views) == 5
    assert any(text.startswith("1 of 6 photos were left out: ") and "2.png" in text for text in capture.warnings)


def test_fault_in_all_photos_is_an_error(tmp_path):
    write_transforms(tmp_path, RIG, NAMES)
    for name in NAMES:
        put(tmp_path / "images" / name, b"")
    with pytest.raises(DataError, match=r"0\.png is empty"):
        open_capture(tmp_path)


def test_bare_cameras_are_never_left_out(tmp_path):
    write_transforms(tmp_path, RIG, NAMES)
    content = json.loads((tmp_path / "transforms.json").read_text())
    del content["frames"][2]["transform_matrix"]
    put_json(tmp_path / "transforms.json", content)
    with pytest.raises(DataError, match="frame 2"):
        open_capture(tmp_path / "transforms.json", photos=False)


def test_tracks_of_removed_photos_are_dropped(tmp_path):
    model = write_colmap(tmp_path, RIG, NAMES)
    del model.images[4:]
    model.write(tmp_path / "sparse" / "0")
    capture = open_capture(tmp_path)
    assert len(capture.views) == 4 and len(capture.points) == 6 and capture.points.view.max() == 3
    assert any("points seen by 2 photos that the model lacks" in text for text in capture.warnings)
