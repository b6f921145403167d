"""Pictures that claim more than they hold are rejected before memory is allocated; large photos are read."""

import io
import struct
import sys
import tracemalloc
import zlib
from itertools import product
from unittest.mock import Mock

import cv2
import numpy as np
import OpenEXR
import pytest
from PIL import Image

from blender_tests.engine.peak import peak_of
from blender_tests.engine.reference.capture_files import png_bytes
from karf_engine.errors import DataError
from karf_engine.io.image_size import image_header
from karf_engine.io.images import read_mask, read_photo

ZIP = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}


def claiming_png(path, width, height, depth, color):
    content = bytearray(png_bytes(8, 8))
    content[16:26] = struct.pack(">IIBB", width, height, depth, color)
    content[29:33] = struct.pack(">I", zlib.crc32(content[12:29]))
    path.write_bytes(content)


def claiming_exr(path, window, last, names=("R", "G", "B")):
    OpenEXR.File(dict(ZIP), {name: np.zeros((8, 8), np.float32) for name in names}).write(str(path))
    content = path.read_bytes()
    start = content.index(window.encode()) + len(window) + 1 + len("box2i") + 1 + 4
    path.write_bytes(content[:start] + struct.pack("<4i", 0, 0, *last) + content[start + 16 :])


def claiming_tiff(path):
    Image.fromarray(np.zeros((8, 8, 3), np.uint8)).save(path)
    content = bytearray(path.read_bytes())
    for tag in (256, 257):  # width and height
        start = content.index(struct.pack("<HHI", tag, 4, 1))
        content[start : start + 12] = struct.pack("<HHII", tag, 4, 1, 60_000)
    path.write_bytes(content)


CLAIMS = {
    "gray.png": lambda path: claiming_png(path, 20_000, 20_000, 8, 0),
    "colors.png": lambda path: claiming_png(path, 13_000, 13_000, 8, 2),
    "deep.png": lambda path: claiming_png(path, 20_000, 20_000, 16, 2),
    "no_end.png": lambda path: claiming_png(path, 2**31 - 1, 2**31 - 1, 16, 6),
    "shown.exr": lambda path: claiming_exr(path, "displayWindow", (24_999, 24_999)),
    "stored.exr": lambda path: claiming_exr(path, "dataWindow", (99_999, 9_999)),
    "layers.exr": lambda path: claiming_exr(path, "dataWindow", (1_999, 1_999), [f"{n:02d}.Z" for n in range(40)]),
    "claims.tif": claiming_tiff,
}


@pytest.mark.parametrize(
    ("name", "read"), [*product(CLAIMS, [read_photo, read_mask]), *product(list(CLAIMS)[:4], [image_header])]
)
def test_small_files_that_claim_many_pixels_are_rejected(tmp_path, name, read):
    CLAIMS[name](tmp_path / name)
    tracemalloc.start()
    with pytest.raises(DataError, match=r"has \d+x\d+ pixels in [\d,]+ bytes; at most \d+ million are read") as caught:
        read(tmp_path / name)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 50e6 and str(tmp_path / name) in caught.value.sentence and caught.value.hint


def test_large_photos_and_well_compressed_masks_are_read(tmp_path):
    stream = io.BytesIO()
    Image.new("L", (8, 8)).save(stream, "JPEG")
    content = bytearray(stream.getvalue())
    start = content.index(b"\xff\xc0") + 5
    content[start : start + 4] = struct.pack(">HH", 8_700, 11_600)
    (tmp_path / "a.jpg").write_bytes(bytes(content) + bytes(20_000_000))  # the size of a camera's file
    assert image_header(tmp_path / "a.jpg").display_size == (11_600, 8_700)
    picture = np.zeros((6_000, 8_000), np.uint8)
    picture[:50, :60] = 255
    Image.fromarray(picture).save(tmp_path / "a.png", compress_level=1)
    assert (tmp_path / "a.png").stat().st_size < picture.size // 50
    assert read_mask(tmp_path / "a.png").sum() == 50 * 60


def float_tiff(path, side):
    cv2.imwrite(str(path), np.zeros((side, side, 3), np.float32), [cv2.IMWRITE_TIFF_COMPRESSION, 8])


def half_exr(path):
    light = np.random.default_rng(0).random((3_000, 4_000, 4), np.float32).astype(np.float16)
    OpenEXR.File(dict(ZIP), {"RGBA": light}).write(str(path))


DEEP = {  # writer, reader, expected error, and maximum memory in megabytes
    "mask.png": (lambda path: cv2.imwrite(str(path), np.zeros((5_000, 5_000, 4), np.uint16)), "read_mask", "", 550),
    "photo.tif": (lambda path: float_tiff(path, 4_000), "read_photo", "", 600),
    "larger.tif": (lambda path: float_tiff(path, 5_600), "read_photo", "DataError", 200),
    "photo.exr": (half_exr, "read_photo", "", 700),
}


@pytest.mark.skipif(sys.platform != "linux", reason="memory is measured on Linux alone")
@pytest.mark.parametrize("name", DEEP)
def test_deep_pictures_take_little_more_memory_than_their_pixels(name, tmp_path):
    make, read, error, megabytes = DEEP[name]
    make(tmp_path / name)
    code = f"from karf_engine.io.images import {read}; {read}(Path(sys.argv[1]))"
    assert peak_of(code, tmp_path / name, fails_with=error) < megabytes * 10**6


def test_lack_of_memory_is_not_reported_as_a_damaged_photo(tmp_path, monkeypatch):
    (tmp_path / "a.png").write_bytes(png_bytes(8, 8))
    monkeypatch.setattr("karf_engine.io.images.iio.imopen", Mock(side_effect=MemoryError))
    with pytest.raises(MemoryError):
        read_photo(tmp_path / "a.png")
