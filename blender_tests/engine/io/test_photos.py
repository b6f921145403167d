"""Photos in and out: every kind of file in every orientation, alpha, linear light, and palettes."""

import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

pytest.importorskip("cv2")
Image = pytest.importorskip("PIL.Image")
iio = pytest.importorskip("imageio.v3")
OpenEXR = pytest.importorskip("OpenEXR")

from blender_tests.engine.reference.capture_files import jpeg_head
from blender_tests.engine.reference.pictures import random_bytes
from karf_engine.errors import DataError
from karf_engine.io.color import linear_to_srgb
from karf_engine.io.image_size import image_header, image_size
from karf_engine.io.images import read_photo, write_png

ORIENTATION = 0x0112  # the tag of Exif and TIFF
PNG_COLORS = {2: 4, 3: 2, 4: 6}  # PNG's numbers of gray with alpha, RGB and RGBA


def random_words(*shape):
    return np.random.default_rng(5).integers(0, 65536, size=shape, dtype=np.uint16)


# ------------------------------------------------------------------------------------------- writers of stored pixels
def exif(orientation):
    tags = Image.Exif()
    tags[ORIENTATION] = orientation
    return tags


def by_pillow(path, pixels, orientation):
    Image.fromarray(pixels).save(path, exif=exif(orientation), quality=100)


def tiff_by_pillow(path, pixels, orientation):
    Image.fromarray(pixels).save(path, tiffinfo={ORIENTATION: orientation})


def by_opencv(path, pixels, orientation):
    iio.imwrite(path, pixels, plugin="opencv")


def bitmap(mode):
    return lambda path, pixels, orientation: Image.fromarray(pixels).convert(mode).save(path)


def gray_tiff(order):
    return lambda path, pixels, orientation: iio.imwrite(path, pixels.astype(f"{order}u2"), plugin="pillow")


def png(path, pixels, orientation):
    """A 16-bit PNG by hand."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    height, width, channels = pixels.shape
    rows = b"".join(b"\0" + row.astype(">u2").tobytes() for row in pixels)
    chunks = [
        chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 16, PNG_COLORS[channels], 0, 0, 0)),
        chunk(b"eXIf", exif(orientation).tobytes().removeprefix(b"Exif\0\0")),
        chunk(b"IDAT", zlib.compress(rows)),
        chunk(b"IEND", b""),
    ]
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunks))


def tiff(order="<", extra=None):
    """A writer of uncompressed 16-bit TIFF 6.0 by hand; extra: what ExtraSamples says of the fourth channel."""

    def write(path, pixels, orientation):
        height, width, channels = pixels.shape
        data = pixels.astype(f"{order}u2").tobytes()
        bits = struct.pack(f"{order}{channels}H", *[16] * channels)
        fields = [
            (256, 4, 1, width), (257, 4, 1, height), (258, 3, channels, 8 + len(data)), (259, 3, 1, 1), (262, 3, 1, 2),
            (273, 4, 1, 8), (274, 3, 1, orientation), (277, 3, 1, channels), (278, 4, 1, height), (279, 4, 1, len(data)),
        ]  # fmt: skip
        if extra is not None:
            fields.append((338, 3, 1, extra))
        directory = struct.pack(f"{order}H", len(fields))
        for tag, kind, count, value in fields:
            is_short = kind == 3 and count == 1
            directory += struct.pack(f"{order}HHI", tag, kind, count)
            directory += struct.pack(f"{order}HH", value, 0) if is_short else struct.pack(f"{order}I", value)
        head = b"II*\0" if order == "<" else b"MM\0*"
        path.write_bytes(
            head + struct.pack(f"{order}I", 8 + len(data) + len(bits)) + data + bits + directory + bytes(4)
        )

    return write


def exr(channels):
    return lambda path, pixels, orientation: OpenEXR.File({}, {channels: pixels}).write(str(path))


# ------------------------------------------------------------------------------------------- every kind and orientation
@dataclass(frozen=True)
class Kind:
    suffix: str
    pixels: np.ndarray  # as stored
    write: Callable[[Path, np.ndarray, int], object]
    is_turned: bool = True  # whether the file can say how it is turned
    tolerance: float = 1e-7  # of 1


RGB, RGBA, DEEP, DEEP_RGBA = random_bytes(5, 7, 3), random_bytes(5, 7, 4), random_words(5, 7, 3), random_words(5, 7, 4)
LIGHT = np.random.default_rng(6).random((5, 7, 3), np.float32)
BLOCK = np.pad(np.full((8, 8), 255, np.uint8), ((0, 8), (0, 24)))  # JPEG keeps it
KINDS = {
    "PNG": Kind(".png", RGB, by_pillow),
    "PNG with alpha": Kind(".png", RGBA, by_pillow),
    "gray PNG": Kind(".png", RGB[..., 0], by_pillow),
    "JPEG": Kind(".jpg", np.dstack([BLOCK] * 3), by_pillow, tolerance=0.05),
    "gray JPEG": Kind(".jpg", BLOCK, by_pillow, tolerance=0.05),
    "TIFF": Kind(".tif", RGB, tiff_by_pillow),
    "deep PNG": Kind(".png", DEEP, png),
    "deep PNG with alpha": Kind(".png", DEEP_RGBA, png),
    "deep gray PNG with alpha": Kind(".png", DEEP_RGBA[..., 2:], png),
    "deep gray PNG": Kind(".png", DEEP[..., 0], by_opencv, False),
    "deep TIFF, little endian": Kind(".tif", DEEP, tiff("<")),
    "deep TIFF, big endian": Kind(".tif", DEEP, tiff(">")),
    "deep TIFF with alpha": Kind(".tif", DEEP_RGBA, tiff(extra=2)),
    "deep TIFF by OpenCV": Kind(".tif", DEEP_RGBA, by_opencv, False),
    "deep gray TIFF, little endian": Kind(".tif", DEEP[..., 0], gray_tiff("<"), False),
    "deep gray TIFF, big endian": Kind(".tif", DEEP[..., 0], gray_tiff(">"), False),
    "float TIFF": Kind(".tif", LIGHT, by_opencv, False),
    "EXR": Kind(".exr", LIGHT, exr("RGB"), False, 1e-6),
    "half EXR": Kind(".exr", LIGHT.astype(np.float16), exr("RGB"), False, 1e-3),
    "gray EXR": Kind(".exr", LIGHT[..., 0].copy(), exr("Y"), False, 1e-6),
    "bitmap of 24 bits": Kind(".bmp", RGB, bitmap("RGB"), False),
    "bitmap of 8 bits": Kind(".bmp", RGB // 255 * 255, bitmap("P"), False),
    "bitmap of 1 bit": Kind(".bmp", RGB[..., 0] // 255 * 255, bitmap("1"), False),
}


def displayed(kind):
    """Stored pixels as colors in [0, 1] with the alpha that they have."""
    pixels = kind.pixels
    if pixels.dtype.kind == "u":
        pixels = pixels / np.iinfo(pixels.dtype).max
    elif kind.suffix == ".exr":
        pixels = linear_to_srgb(pixels.astype(np.float64))
    if pixels.ndim == 2:
        return np.dstack([pixels] * 3)
    return pixels[..., [0, 0, 0, 1]] if pixels.shape[2] == 2 else pixels


def turned(pixels, orientation):
    """Exif 2.3: where the first stored row and column are seen."""
    turns = {1: 0, 2: 0, 3: 2, 4: 2, 5: 3, 6: 3, 7: 1, 8: 1}[orientation]
    pixels = np.rot90(pixels, turns)
    return pixels[:, ::-1] if orientation in (2, 4, 5, 7) else pixels


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_is_read_with_its_depth_upright_and_as_stored(tmp_path, name):
    kind = KINDS[name]
    path = tmp_path / f"a{kind.suffix}"
    for orientation in range(1, 9) if kind.is_turned else [1]:
        kind.write(path, kind.pixels, orientation)
        upright, stored, header = read_photo(path), read_photo(path, upright=False), image_header(path)
        assert upright.dtype == np.float32
        assert_allclose(upright, turned(displayed(kind), orientation), atol=kind.tolerance)
        assert_allclose(stored, displayed(kind), atol=kind.tolerance)
        assert image_size(path) == header.display_size == upright.shape[1::-1]
        assert header.stored_size == stored.shape[1::-1]
        assert header.deep == (kind.suffix == ".exr" or (kind.pixels.dtype != np.uint8 and kind.pixels.ndim == 3))


@pytest.mark.parametrize("options", [{"lossless": True}, {"lossless": False}, {"exif": b"Exif\0\0"}])
@pytest.mark.parametrize("channels", [3, 4])
def test_webp_of_every_chunk_has_its_size(tmp_path, options, channels):
    Image.fromarray(random_bytes(21, 37, channels)).save(tmp_path / "a.webp", **options)
    assert image_size(tmp_path / "a.webp") == read_photo(tmp_path / "a.webp").shape[1::-1] == (37, 21)


def test_the_size_of_a_progressive_jpeg_follows_a_fill_byte(tmp_path):
    (tmp_path / "a.jpg").write_bytes(jpeg_head(300, 200, orientation=5))
    header = image_header(tmp_path / "a.jpg")
    assert (header.stored_size, header.display_size) == ((300, 200), (200, 300))


def test_a_bitmap_may_begin_with_its_top_row(tmp_path):
    bitmap("RGB")(tmp_path / "a.bmp", RGB, 1)
    data = bytearray((tmp_path / "a.bmp").read_bytes())
    struct.pack_into("<i", data, 22, -5)
    (tmp_path / "a.bmp").write_bytes(data)
    assert image_size(tmp_path / "a.bmp") == (7, 5)


# ---------------------------------------------------------------------------------------------- palettes, alpha and light
def test_palette_pictures_become_rgb_and_keep_their_transparent_entry(tmp_path):
    palette = Image.fromarray(np.array([[0, 1]], np.uint8)).convert("P")
    palette.putpalette([255, 0, 0, 0, 51, 255])
    palette.save(tmp_path / "palette.png")
    assert_allclose(read_photo(tmp_path / "palette.png"), [[[1, 0, 0], [0, 0.2, 1]]])
    palette.save(tmp_path / "transparent.png", transparency=0)
    assert_allclose(read_photo(tmp_path / "transparent.png"), [[[1, 0, 0, 0], [0, 0.2, 1, 1]]])


def test_premultiplied_alpha_of_a_tiff_is_taken_off(tmp_path):
    pixels = np.array([[[20000, 10000, 0, 40000], [7, 7, 7, 0]]], np.uint16)
    tiff(extra=1)(tmp_path / "a.tif", pixels, 1)
    assert_allclose(read_photo(tmp_path / "a.tif"), [[[0.5, 0.25, 0, 40000 / 65535], [0, 0, 0, 0]]], atol=1e-6)


def test_premultiplied_alpha_of_an_exr_is_taken_off(tmp_path):
    light = np.array([[[0.25, 0.125, 0, 0.5], [0, 0, 0, 0], [1, 0.5, 0.25, 1]]], np.float32)
    exr("ViewLayer.Combined")(tmp_path / "a.exr", light, 1)
    straight = np.array([[[0.5, 0.25, 0], [0, 0, 0], [1, 0.5, 0.25]]])
    expected = np.concatenate([linear_to_srgb(straight), light[..., 3:]], -1)
    assert_allclose(read_photo(tmp_path / "a.exr"), expected, atol=1e-6)


@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_light_beyond_display_colors_is_clipped(tmp_path, kind):
    light = np.array([[[0, 0.002, 0.18], [0.5, 1, 30]], [[np.nan, -1, np.inf], [0.25, 0.25, 0.25]]], kind)
    exr("RGB")(tmp_path / "a.exr", light, 1)
    expected = linear_to_srgb(np.array([[[0, 0.002, 0.18], [0.5, 1, 1]], [[0, 0, 1], [0.25, 0.25, 0.25]]]))
    assert_allclose(read_photo(tmp_path / "a.exr"), expected, atol=1e-3 if kind == np.float16 else 1e-6)
    assert_allclose(read_photo(tmp_path / "a.exr")[0, 0, 2], 0.4614, atol=1e-3)  # middle gray


@pytest.mark.parametrize(("left", "top"), [(1, 2), (-2, -1)])
def test_exr_pictures_are_as_large_as_their_display_window(tmp_path, left, top):
    light = LIGHT[:3, :4, 0].copy()
    window = {"displayWindow": ((0, 0), (5, 6)), "dataWindow": ((left, top), (left + 3, top + 2))}
    OpenEXR.File(window, {"Y": light}).write(str(tmp_path / "a.exr"))
    whole = np.zeros((20, 20))
    whole[10 + top : 13 + top, 10 + left : 14 + left] = linear_to_srgb(light)
    expected = np.repeat(whole[10:17, 10:16, None], 3, -1)
    assert_allclose(read_photo(tmp_path / "a.exr"), expected, atol=1e-6)
    assert image_size(tmp_path / "a.exr") == (6, 7)


def test_exr_files_without_colors_are_named(tmp_path):
    exr("Z")(tmp_path / "a.exr", np.ones((2, 2), np.float32), 1)
    with pytest.raises(DataError, match=r"a\.exr cannot be read as a picture: it has no colors among its channels Z"):
        read_photo(tmp_path / "a.exr")


# ----------------------------------------------------------------------------------------------------------------- writing
@pytest.mark.parametrize("pixels", [RGB, RGBA], ids=["RGB", "RGBA"])
def test_eight_bit_colors_survive_a_round_trip(tmp_path, pixels):
    write_png(tmp_path / "a.png", pixels)
    photo = read_photo(tmp_path / "a.png")
    assert_array_equal(photo, pixels.astype(np.float32) / 255)
    write_png(tmp_path / "b.png", photo)
    assert (tmp_path / "b.png").read_bytes() == (tmp_path / "a.png").read_bytes()


def test_sixteen_bit_gray_survives_a_round_trip(tmp_path):
    write_png(tmp_path / "a.png", DEEP[..., 0])
    assert_array_equal(np.rint(read_photo(tmp_path / "a.png") * 65535), np.dstack([DEEP[..., 0]] * 3))


def test_floats_are_clipped_and_rounded_to_the_nearest_byte(tmp_path):
    write_png(tmp_path / "a.png", np.array([[-1.0, 0.6 / 255, 0.4 / 255, 254.6 / 255, 2.0]]))
    assert_array_equal(np.asarray(Image.open(tmp_path / "a.png")), [[0, 1, 0, 255, 255]])


@pytest.mark.parametrize("array", [np.zeros((2, 2), np.int64), np.zeros((2, 2, 3), np.uint16)], ids=["int64", "deep"])
def test_arrays_that_are_no_picture_are_refused(tmp_path, array):
    with pytest.raises(TypeError):
        write_png(tmp_path / "a.png", array)
    assert not list(tmp_path.iterdir())
