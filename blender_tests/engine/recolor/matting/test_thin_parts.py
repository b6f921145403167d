"""What rough masks say to a photo's mattes: in the grid that these are made in, and of which objects thin parts are known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import View
from karf_engine.recolor.matting.thin_parts import Marks, read_marks, undistort_marks

CAMERA = Camera(24, 16, 20.0, 20.0, 12.0, 8.0, np.eye(4))
VIEW = View("left", "left", CAMERA, Path("left.jpg"), "train")
BENT = replace(CAMERA, distortion=(0.3, 0.0, 0.0, 0.0))


def draw(path: Path, mask: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray((mask * 255).astype(np.uint8)).save(path)


@pytest.fixture
def mask() -> np.ndarray:
    drawn = np.zeros((16, 24), bool)
    drawn[2:9, 3:12] = True
    return drawn


def test_each_object_has_what_is_drawn_of_it_on_this_photo(tmp_path, mask):
    draw(tmp_path / "pot" / "left.png", mask)
    draw(tmp_path / "mug" / "right.png", ~mask)
    marks = read_marks(tmp_path, ["mug", "pot"], VIEW)
    assert not marks.drawn[0].any() and np.array_equal(marks.drawn[1], mask)


def test_a_photo_that_nothing_is_drawn_on_has_none(tmp_path, mask):
    draw(tmp_path / "pot" / "right.png", mask)
    assert read_marks(tmp_path, ["pot"], VIEW) == Marks(None, (False,))
    assert read_marks(tmp_path / "no folder", ["pot"], VIEW) == Marks(None, (False,))


def test_an_object_has_a_thin_part_where_a_mask_of_any_photo_shows_one(tmp_path):
    blob = np.zeros((100, 200), bool)
    blob[20:60, 20:60] = True
    draw(tmp_path / "pot" / "left.png", blob)
    draw(tmp_path / "lamp" / "left.png", blob)
    assert read_marks(tmp_path, ["lamp", "pot"], VIEW).thin == (False, False)
    blob[40:42, 60:90] = True
    draw(tmp_path / "lamp" / "right.png", blob)
    assert read_marks(tmp_path, ["lamp", "pot"], VIEW).thin == (True, False)
    draw(tmp_path / "lamp" / "right.png", ~blob)  # drawn anew
    assert read_marks(tmp_path, ["lamp", "pot"], VIEW).thin == (False, False)


def test_a_mask_that_cannot_be_read_says_nothing(tmp_path, mask):
    draw(tmp_path / "pot" / "left.png", mask)
    (tmp_path / "pot" / "left.png").write_bytes(b"no picture")
    marks = read_marks(tmp_path, ["pot"], VIEW)
    assert not marks.drawn.any() and marks.thin == (False,)


@pytest.mark.parametrize("camera, says", [(CAMERA, True), (BENT, False)])
def test_a_mask_of_the_working_size_is_a_pinhole_s(tmp_path, mask, camera, says):
    draw(tmp_path / "pot" / "left.png", mask[::2, ::2])
    assert read_marks(tmp_path, ["pot"], replace(VIEW, camera=camera)).drawn.any() == says


def test_a_pinhole_shows_the_marks_of_its_lens_straightened(mask):
    marks, unmarked = Marks(mask[None], (True,)), Marks(None, (True,))
    assert undistort_marks(unmarked, BENT) is unmarked and undistort_marks(marks, CAMERA) is marks
    straight = undistort_marks(marks, BENT)
    assert straight.thin == marks.thin and straight.drawn.shape == marks.drawn.shape and straight.drawn.dtype == bool
    assert straight.drawn.any() and not np.array_equal(straight.drawn, marks.drawn)
