"""Copies of photos for programs that do not read their kind."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from karf_engine.capture.camera import Camera
from karf_engine.capture.transforms import camera_to_json
from karf_engine.errors import DataError
from karf_engine.io.images import read_photo
from karf_engine.worker.queries import QUERIES
from karf_engine.worker.queries.session import Session


def ask(folder, path, width, height):
    camera = camera_to_json(Camera(width, height, 50.0, 50.0, width / 2, height / 2, np.eye(4)))
    answer = QUERIES["photo"](Session(folder), {"photo": str(path), "camera": camera})
    return read_photo(Path(answer["photo"]))


@pytest.mark.parametrize(("orientation", "size"), [(1, (96, 64)), (6, (64, 96)), (6, (96, 64))])
def test_a_copy_stands_as_its_camera(orientation, size, tmp_path):
    pixels = np.zeros((64, 96, 3), np.uint8)
    pixels[:32] = 255
    tags = Image.Exif()
    tags[0x0112] = orientation
    Image.fromarray(pixels).save(tmp_path / "a.avif", exif=tags, quality=95)
    copy, stored = ask(tmp_path, tmp_path / "a.avif", *size), pixels / 255
    is_turned = orientation == 6 and size == (64, 96)
    assert np.abs(copy - (np.rot90(stored, -1) if is_turned else stored)).mean() < 0.02


def test_transparency_is_put_on_white(tmp_path):
    Image.new("RGBA", (8, 6), (255, 0, 0, 0)).save(tmp_path / "a.png")
    assert ask(tmp_path, tmp_path / "a.png", 8, 6).min() == 1


def test_a_photo_of_another_size_than_its_camera_is_refused(tmp_path):
    Image.new("RGB", (8, 6)).save(tmp_path / "a.png")
    with pytest.raises(DataError, match="8"):
        ask(tmp_path, tmp_path / "a.png", 9, 6)
