"""HEIC and AVIF photos, and files that are not photos: each is recognized by its content."""

import struct

import numpy as np
import pytest
from PIL import Image

from karf_engine.errors import DataError
from karf_engine.io.image_size import find_header, image_header
from karf_engine.io.images import apply_exif_orientation, read_photo
from karf_engine.recolor.photos import open_photo, suffix_for


@pytest.fixture
def pixels():
    coarse = np.random.default_rng(2).integers(0, 255, (6, 8, 3), np.uint8)
    return np.asarray(Image.fromarray(coarse).resize((160, 120), Image.Resampling.BICUBIC))


def turn_heic(path):
    """Give the photo the property irot, a quarter turn, as phones do: its writer here cannot."""
    content = path.read_bytes()
    at = content.index(b"pixi") - 4
    size = struct.unpack_from(">I", content, at)[0]
    turn = struct.pack(">I4sB", size, b"irot", 1).ljust(size, b"\0")  # in place of the number of bits
    path.write_bytes(content[:at] + turn + content[at + size :])


def test_rotated_heic_photo_has_the_size_of_its_pixels(pixels, tmp_path):
    Image.fromarray(pixels).save(tmp_path / "a.heic", quality=95)
    turn_heic(tmp_path / "a.heic")
    assert find_header(tmp_path / "a.heic").display_size == (120, 160)
    assert np.abs(read_photo(tmp_path / "a.heic") - np.rot90(pixels) / 255).mean() < 0.02


@pytest.mark.opens("photo", "phones", "HEIC, HEIF, AVIF", "turned, in tiles, with a profile")
@pytest.mark.parametrize(("name", "orientations"), [("a.heic", [1]), ("a.HEIF", [1]), ("a.avif", range(1, 9))])
def test_size_and_pixels_are_those_of_the_upright_photo(name, orientations, pixels, tmp_path):
    for orientation in orientations:
        tags = Image.Exif()
        tags[0x0112] = orientation
        Image.fromarray(pixels).save(tmp_path / name, quality=95, exif=tags)
        header, photo = find_header(tmp_path / name), read_photo(tmp_path / name)
        assert (header.kind, header.orientation) == ("heic" if "h" in name.lower() else "avif", orientation)
        assert header.display_size == photo.shape[1::-1] == ((120, 160) if orientation > 4 else (160, 120))
        assert np.abs(photo - apply_exif_orientation(pixels, orientation) / 255).mean() < 0.02
        stored = open_photo(tmp_path / name)
        assert stored.size == header.stored_size and suffix_for(stored) == ".png"


def test_large_photos_of_tiles_have_one_size(tmp_path):
    Image.new("RGB", (2200, 1500)).save(tmp_path / "a.heic", quality=20)
    assert image_header(tmp_path / "a.heic").display_size == (2200, 1500)


KINDS = {
    "a.gif": (b"GIF89a", "is a GIF"),
    "a.psd": (b"8BPS\0\1", "is a Photoshop document"),
    "a.jxl": (b"\0\0\0\x0cJXL \r\n\x87\n", "is a JPEG XL"),
    "a.jp2": (b"\0\0\0\x0cjP  \r\n\x87\n", "is a JPEG 2000"),
    "a.mov": (b"\0\0\0\x14ftypqt  ", "is a video"),
    "a.mp4": (b"\0\0\0\x18ftypmp42", "is a video"),
    "a.CR2": (b"II*\0\x10\0\0\0CR\2\0", "is a raw file of a camera. Develop all photos to JPEG or 16-bit TIFF"),
    "a.dng": (b"II*\0\x08\0\0\0", "is a raw file of a camera"),
    "a.heic": (b"\0\0\0\x18ftypheic\0\0\0\0", "no complete PNG, JPEG"),
}


@pytest.mark.parametrize("name", KINDS)
def test_other_files_are_rejected_by_kind(name, tmp_path):
    content, words = KINDS[name]
    (tmp_path / name).write_bytes(content + bytes(60))
    with pytest.raises(DataError, match=f"{name}.*{words}"):
        image_header(tmp_path / name)
