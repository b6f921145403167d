"""Photos of more than eight bits a channel, in PNG, TIFF and EXR: depth, orientation, alpha, linear light."""

import struct

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

pytest.importorskip("cv2")
Image = pytest.importorskip("PIL.Image")
iio = pytest.importorskip("imageio.v3")
OpenEXR = pytest.importorskip("OpenEXR")

from blender_tests.engine.reference.pictures import random_bytes
from karf_engine.errors import DataError
from karf_engine.io.color import linear_to_srgb
from karf_engine.io.image_size import image_header, image_size
from karf_engine.io.images import read_photo


def random_words(*shape):
    return np.random.default_rng(5).integers(0, 65536, size=shape, dtype=np.uint16)


def write_tiff(path, pixels, orientation=1, extra=None, order="<"):
    """Uncompressed 16-bit TIFF 6.0 by hand, with an orientation and, for the 4th channel, ExtraSamples."""
    height, width, channels = pixels.shape
    data = pixels.astype(f"{order}u2").tobytes()
    bits = struct.pack(f"{order}{channels}H", *[16] * channels)
    fields = [
        (256, 4, 1, width), (257, 4, 1, height), (258, 3, channels, 8 + len(data)), (259, 3, 1, 1), (262, 3, 1, 2),
        (273, 4, 1, 8), (274, 3, 1, orientation), (277, 3, 1, channels), (278, 4, 1, height), (279, 4, 1, len(data)),
        *([] if extra is None else [(338, 3, 1, extra)]),
    ]  # fmt: skip
    entries = [
        struct.pack(f"{order}HHIHH" if kind == 3 and count == 1 else f"{order}HHII", tag, kind, count, value, *pad)
        for tag, kind, count, value in fields
        for pad in [(0,) if kind == 3 and count == 1 else ()]
    ]
    head = (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(f"{order}I", 8 + len(data) + len(bits))
    directory = struct.pack(f"{order}H", len(fields)) + b"".join(entries) + bytes(4)
    path.write_bytes(head + data + bits + directory)


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("ending", ["png", "tif"])
def test_sixteen_bit_colors_keep_their_depth(tmp_path, ending, channels):
    pixels = random_words(5, 7, channels)
    path = tmp_path / f"a.{ending}"
    iio.imwrite(path, pixels, plugin="opencv")
    photo = read_photo(path)
    assert photo.dtype == np.float32
    assert_array_equal(np.round(photo * 65535), pixels)
    assert image_size(path) == (7, 5) and image_header(path).deep


@pytest.mark.parametrize("order", ["<", ">"])
def test_float_and_gray_tiffs_keep_their_depth(tmp_path, order):
    colors = np.random.default_rng(6).random((5, 7, 3), np.float32)
    iio.imwrite(tmp_path / "float.tif", colors, plugin="opencv")
    assert_array_equal(read_photo(tmp_path / "float.tif"), colors)
    gray = random_words(5, 7)
    iio.imwrite(tmp_path / "gray.tif", gray.astype(f"{order}u2"), plugin="pillow")
    assert_array_equal(np.round(read_photo(tmp_path / "gray.tif")[..., 1] * 65535), gray)
    assert image_size(tmp_path / "gray.tif") == (7, 5)


def test_gray_with_alpha_at_sixteen_bits_keeps_its_depth(tmp_path):
    rgba = random_words(5, 7, 4)
    rgba[..., 1:3] = rgba[..., :1]
    rows = b"".join(b"\0" + row.astype(">u2").tobytes() for row in rgba[..., 2:])
    (tmp_path / "a.png").write_bytes(png(7, 5, 4, rows))
    assert_array_equal(np.round(read_photo(tmp_path / "a.png") * 65535), rgba)


def png(width, height, color, rows, exif=b""):
    """A 16-bit PNG by hand."""
    import zlib

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 16, color, 0, 0, 0)
    orientation = chunk(b"eXIf", exif) if exif else b""
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        [chunk(b"IHDR", header), orientation, chunk(b"IDAT", zlib.compress(rows)), chunk(b"IEND", b"")]
    )


def shown(pixels, orientation):
    """Exif 2.3: where the first stored row and column are seen."""
    turns = {1: 0, 2: 0, 3: 2, 4: 2, 5: 3, 6: 3, 7: 1, 8: 1}[orientation]
    turned = np.rot90(pixels, turns)
    return turned[:, ::-1] if orientation in (2, 4, 5, 7) else turned


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_deep_photos_are_turned_like_others(tmp_path, orientation, order):
    pixels = random_words(5, 7, 3)
    write_tiff(tmp_path / "a.tif", pixels, orientation, order=order)
    exif = Image.Exif()
    exif[0x0112] = orientation
    rows = b"".join(b"\0" + row.astype(">u2").tobytes() for row in pixels)
    (tmp_path / "a.png").write_bytes(png(7, 5, 2, rows, exif.tobytes().removeprefix(b"Exif\0\0")))
    for path in (tmp_path / "a.tif", tmp_path / "a.png"):
        expected = shown(pixels, orientation)
        assert_array_equal(np.round(read_photo(path) * 65535), expected)
        assert_array_equal(np.round(read_photo(path, upright=False) * 65535), pixels)
        assert image_header(path).display_size == expected.shape[1::-1] and image_header(path).stored_size == (7, 5)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_eight_bit_tiffs_and_pngs_are_turned_too(tmp_path, orientation):
    pixels = random_bytes(5, 7, 3)
    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.fromarray(pixels).save(tmp_path / "a.tif", tiffinfo={0x0112: orientation})
    Image.fromarray(pixels).save(tmp_path / "a.png", exif=exif)
    for path in (tmp_path / "a.tif", tmp_path / "a.png"):
        expected = shown(pixels, orientation)
        assert_array_equal(np.round(read_photo(path) * 255), expected)
        assert_array_equal(np.round(read_photo(path, upright=False) * 255), pixels)
        assert image_header(path).display_size == expected.shape[1::-1] and image_header(path).stored_size == (7, 5)


def test_premultiplied_alpha_of_a_tiff_is_taken_off(tmp_path):
    pixels = np.array([[[20000, 10000, 0, 40000], [7, 7, 7, 0]]], np.uint16)
    write_tiff(tmp_path / "a.tif", pixels, extra=1)
    assert_allclose(read_photo(tmp_path / "a.tif"), [[[0.5, 0.25, 0, 40000 / 65535], [0, 0, 0, 0]]], atol=1e-6)
    write_tiff(tmp_path / "a.tif", pixels, extra=2)
    assert_array_equal(np.round(read_photo(tmp_path / "a.tif") * 65535), pixels)


@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_linear_light_of_exr_becomes_display_colors(tmp_path, kind):
    light = np.array([[[0, 0.002, 0.18], [0.5, 1, 30]], [[np.nan, -1, np.inf], [0.25, 0.25, 0.25]]], kind)
    OpenEXR.File({}, {"RGB": light}).write(str(tmp_path / "a.exr"))
    expected = linear_to_srgb(np.array([[[0, 0.002, 0.18], [0.5, 1, 1]], [[0, 0, 1], [0.25, 0.25, 0.25]]]))
    assert_allclose(read_photo(tmp_path / "a.exr"), expected, atol=1e-3 if kind == np.float16 else 1e-6)
    assert_allclose(read_photo(tmp_path / "a.exr")[0, 0, 2], 0.4614, atol=1e-3)  # middle gray
    assert image_size(tmp_path / "a.exr") == (2, 2)


def test_exr_alpha_is_kept_and_its_colors_become_straight(tmp_path):
    light = np.array([[[0.25, 0.125, 0, 0.5], [0, 0, 0, 0], [1, 0.5, 0.25, 1]]], np.float32)
    OpenEXR.File({}, {"ViewLayer.Combined": light}).write(str(tmp_path / "a.exr"))
    straight = np.array([[[0.5, 0.25, 0], [0, 0, 0], [1, 0.5, 0.25]]])
    expected = np.concatenate([linear_to_srgb(straight), light[..., 3:]], -1)
    assert_allclose(read_photo(tmp_path / "a.exr"), expected, atol=1e-6)


def test_exr_pictures_are_as_large_as_their_display_window(tmp_path):
    light = np.random.default_rng(7).random((3, 4), np.float32)
    for left, top in ((1, 2), (-2, -1)):
        window = {"displayWindow": ((0, 0), (5, 6)), "dataWindow": ((left, top), (left + 3, top + 2))}
        OpenEXR.File(window, {"Y": light}).write(str(tmp_path / "a.exr"))
        whole = np.zeros((20, 20))
        whole[10 + top : 13 + top, 10 + left : 14 + left] = linear_to_srgb(light)
        expected = np.repeat(whole[10:17, 10:16, None], 3, -1)
        assert_allclose(read_photo(tmp_path / "a.exr"), expected, atol=1e-6)
        assert image_size(tmp_path / "a.exr") == (6, 7)


def test_exr_files_without_colors_are_named(tmp_path):
    OpenEXR.File({}, {"Z": np.ones((2, 2), np.float32)}).write(str(tmp_path / "a.exr"))
    with pytest.raises(DataError, match=r"a\.exr cannot be read as a picture: it has no colors among its channels Z"):
        read_photo(tmp_path / "a.exr")


@pytest.mark.parametrize("ending", ["png", "tif", "exr"])
def test_truncated_deep_photos_are_named(tmp_path, ending):
    path = tmp_path / f"a.{ending}"
    if ending == "exr":
        OpenEXR.File({}, {"RGB": np.random.default_rng(8).random((60, 60, 3), np.float32)}).write(str(path))
    else:
        iio.imwrite(path, random_words(60, 60, 3), plugin="opencv")
    path.write_bytes(path.read_bytes()[:6000])
    with pytest.raises(DataError, match=rf"a\.{ending} cannot be read as a picture"):
        read_photo(path)


@pytest.mark.parametrize("options", [{"bits": 1}, {"bits": 8}, {"bits": 24}])
def test_bitmap_header_sizes_agree_with_the_pixels(tmp_path, options):
    mode = {1: "1", 8: "P", 24: "RGB"}[options["bits"]]
    iio.imwrite(tmp_path / "a.bmp", np.asarray(Image.fromarray(random_bytes(5, 7, 3)).convert(mode)), plugin="pillow")
    assert image_size(tmp_path / "a.bmp") == read_photo(tmp_path / "a.bmp").shape[1::-1] == (7, 5)
    data = bytearray((tmp_path / "a.bmp").read_bytes())
    struct.pack_into("<i", data, 22, -5)  # rows from the top
    (tmp_path / "a.bmp").write_bytes(data)
    assert image_size(tmp_path / "a.bmp") == (7, 5)
