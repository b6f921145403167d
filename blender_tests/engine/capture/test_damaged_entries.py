"""One bad photo or pose leaves a capture usable: it is left out, counted and named."""

import re

import numpy as np
import pytest

from blender_tests.engine.reference.capture_files import (
    frames_of,
    llff_table,
    put,
    put_json,
    put_photos,
    random_rig,
    write_colmap,
)
from karf_engine.capture import open_capture
from karf_engine.errors import DataError

NAMES = [f"{number}.png" for number in range(6)]
RIG = random_rig(5, 6)


def write_transforms(folder, damage):
    frames = frames_of(NAMES, RIG)
    damage(frames[2])
    put_json(folder / "transforms.json", {"fl_x": 30.0, "w": RIG[0].width, "h": RIG[0].height, "frames": frames})
    put_photos(folder, NAMES, RIG)


def write_llff(folder, damage):
    table = llff_table(RIG)
    damage(table[2])
    np.save(folder / "poses_bounds.npy", table)
    put_photos(folder / "images", NAMES, RIG)


def write_model(folder, damage):
    model = write_colmap(folder, RIG, NAMES, one_lens=False)
    model.images[2] = damage(*model.images[2])
    model.write(folder / "sparse" / "0")


def put_nan_into(key):
    return lambda frame: frame.update({key: float("nan")})


def set_pose(value):
    return lambda number, pose, camera, name, features: (number, np.full(7, value), camera, name, features)


def set_lens(number, pose, camera, name, features):
    return number, pose, 99, name, features


DAMAGES = [
    (write_transforms, lambda frame: frame.pop("file_path"), "frame 2 has no file_path"),
    (write_transforms, lambda frame: frame.pop("transform_matrix"), "frame 2 .* no 4x4 transform_matrix"),
    (write_transforms, lambda frame: frame["transform_matrix"][1].__setitem__(3, float("nan")), "not finite"),
    (write_transforms, put_nan_into("fl_x"), "frame 2 .* fl_x = nan"),
    (write_llff, lambda row: row.__setitem__(slice(0, 3), np.nan), "row 2 has a pose that is not finite"),
    (write_llff, lambda row: row.__setitem__(14, 0), "row 2 has the focal length"),
    (write_model, set_pose(np.nan), "image 98 .'2.png'. has a pose that is not a rotation"),
    (write_model, set_pose(0.0), "has a pose that is not a rotation"),
    (write_model, set_lens, "was taken by camera 99, which is missing from cameras.bin"),
]


@pytest.mark.parametrize(("write", "damage", "words"), DAMAGES)
def test_a_photo_with_a_bad_pose_is_left_out(tmp_path, write, damage, words):
    write(tmp_path, damage)
    capture = open_capture(tmp_path)
    assert [view.stem for view in capture.views] == ["0", "1", "3", "4", "5"]
    (remark,) = [text for text in capture.warnings if "left out" in text]
    assert remark.startswith("1 of 6 photos were left out: ")
    assert re.search(words, remark)


@pytest.mark.parametrize("write", [write_transforms, write_llff, write_model])
@pytest.mark.parametrize("content", [b"", b"not a picture"])
def test_an_empty_photo_is_left_out(tmp_path, write, content):
    write(tmp_path, lambda *entry: entry)
    (photo,) = tmp_path.rglob("2.png")
    put(photo, content)
    capture = open_capture(tmp_path)
    assert len(capture.views) == 5
    assert any(text.startswith("1 of 6 photos were left out: ") and "2.png" in text for text in capture.warnings)


def test_a_fault_in_all_photos_is_an_error(tmp_path):
    write_transforms(tmp_path, lambda frame: None)
    for name in NAMES:
        put(tmp_path / name, b"")
    with pytest.raises(DataError, match=r"0\.png is empty"):
        open_capture(tmp_path)


def test_bare_cameras_are_never_left_out(tmp_path):
    write_transforms(tmp_path, lambda frame: frame.pop("transform_matrix"))
    with pytest.raises(DataError, match="frame 2"):
        open_capture(tmp_path / "transforms.json", photos=False)


def test_tracks_of_removed_photos_are_dropped(tmp_path):
    model = write_colmap(tmp_path, RIG, NAMES)
    del model.images[4:]
    model.write(tmp_path / "sparse" / "0")
    capture = open_capture(tmp_path)
    assert len(capture.views) == 4 and len(capture.points) == 6 and capture.points.view.max() == 3
    assert any("points seen by 2 photos that the model lacks" in text for text in capture.warnings)
