"""What rough masks say of the photo that they were drawn on, in the grid that its mattes are made in."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import View
from karf_engine.recolor.marks import marks_of, straightened

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
    marks = marks_of(tmp_path, ["mug", "pot"], VIEW)
    assert not marks[0].any() and np.array_equal(marks[1], mask)


def test_a_photo_that_nothing_is_drawn_on_has_none(tmp_path, mask):
    draw(tmp_path / "pot" / "right.png", mask)
    assert marks_of(tmp_path, ["pot"], VIEW) is None
    assert marks_of(tmp_path / "no folder", ["pot"], VIEW) is None


def test_a_mask_that_cannot_be_read_says_nothing(tmp_path, mask):
    draw(tmp_path / "pot" / "left.png", mask)
    (tmp_path / "pot" / "left.png").write_bytes(b"no picture")
    assert not marks_of(tmp_path, ["pot"], VIEW).any()


@pytest.mark.parametrize("camera, says", [(CAMERA, True), (BENT, False)])
def test_a_mask_of_the_working_size_is_a_pinhole_s(tmp_path, mask, camera, says):
    draw(tmp_path / "pot" / "left.png", mask[::2, ::2])
    assert marks_of(tmp_path, ["pot"], replace(VIEW, camera=camera)).any() == says


def test_a_pinhole_shows_the_marks_of_its_lens_straightened(mask):
    marks = mask[None]
    assert straightened(None, BENT) is None and straightened(marks, CAMERA) is marks
    straight = straightened(marks, BENT)
    assert straight.shape == marks.shape and straight.dtype == bool
    assert straight.any() and not np.array_equal(straight, marks)
