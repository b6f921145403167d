"""Headers bring the ICC profile along, without a library: Blender has none."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from PIL import Image

from karf_engine.io.icc import profile_space
from karf_engine.io.icc_matrix import matrix_space
from karf_engine.io.image_size import find_header

from .test_color_profiles import DISPLAY_P3, GRAY_GAMMA_18

LONG = DISPLAY_P3 + bytes(150_000)  # several segments of a JPEG


def save(path: Path, **options):
    Image.new("RGB", (8, 6), (200, 60, 40)).save(path, **options)
    return find_header(path)


@pytest.mark.parametrize("name", ["a.png", "a.jpg"])
@pytest.mark.parametrize("data", [DISPLAY_P3, LONG, b""])
def test_the_header_has_the_profile_of_the_file_beside_its_orientation(name, data, tmp_path):
    tags = Image.Exif()
    tags[0x0112] = 6
    header = save(tmp_path / name, icc_profile=data, exif=tags)
    assert header.profile == data and header.display_size == (6, 8)


def test_a_damaged_profile_is_none(tmp_path):
    save(tmp_path / "a.png", icc_profile=DISPLAY_P3)
    content = (tmp_path / "a.png").read_bytes()
    at = content.index(b"iCCP") + 20
    (tmp_path / "a.png").write_bytes(content[:at] + b"\xff" * 20 + content[at + 20 :])
    assert find_header(tmp_path / "a.png").stored_size == (8, 6)


@pytest.mark.parametrize("data", [b"", b"damaged", GRAY_GAMMA_18])
def test_profiles_of_other_kinds_have_no_matrix(data):
    assert matrix_space(data) is None


def test_the_space_is_that_of_the_engine():
    colors = np.random.default_rng(1).random((40, 3), np.float32)
    assert_array_equal(matrix_space(DISPLAY_P3).to_srgb(colors), profile_space(DISPLAY_P3).to_srgb(colors))
