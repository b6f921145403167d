"""Reading and writing photos: every kind of file and orientation, alpha, linear light, and palettes."""

import struct
import zlib

import imageio.v3 as iio
import numpy as np
import OpenEXR
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image

from blender_tests.engine.reference.capture_files import jpeg_head
from blender_tests.engine.reference.pictures import random_bytes
from karf_engine.errors import DataError
from karf_engine.io.color import linear_to_srgb
from karf_engine.io.image_size import image_header, image_size
from karf_engine.io.images import read_photo, write_png

ORIENTATION = 0x0112  # the tag of Exif and TIFF
PNG_COLORS = {2: 4, 3: 2, 4: 6}  # PNG's numbers of gray with alpha, RGB and RGBA


def exif(orientation):
    tags = Image.Exif()
    tags[ORIENTATION] = orientation
    return tags


def by_pillow(path, pixels, orientation):
    Image.fromarray(pixels).save(path, exif=exif(orientation), quality=100)


def tiff_by_pillow(path, pixels, orientation):
    Image.fromarray(pixels).save(path, tiffinfo={ORIENTATION: orientation})


def by_opencv(path, pixels, orientation=1):
    iio.imwrite(path, pixels, plugin="opencv")


def bitmap(mode):
    return lambda path, pixels, orientation=1: Image.fromarray(pixels).convert(mode).save(path)


def gray_tiff(order):
    return lambda path, pixels, orientation: iio.imwrite(path, pixels.astype(f"{order}u2"), plugin="pillow")


def png(path, pixels, orientation):
    """Write a 16-bit PNG without a library."""
    height, width, channels = pixels.shape
    chunks = {
        b"IHDR": struct.pack(">IIBBBBB", width, height, 16, PNG_COLORS[channels], 0, 0, 0),
        b"eXIf": exif(orientation).tobytes().removeprefix(b"Exif\0\0"),
        b"IDAT": zlib.compress(b"".join(b"\0" + row.astype(">u2").tobytes() for row in pixels)),
        b"IEND": b"",
    }
    content = b"\x89PNG\r\n\x1a\n"
    for kind, data in chunks.items():
        content += struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    path.write_bytes(content)


def tiff(order="<", extra=None):
    """A writer of uncompressed 16-bit TIFF 6.0 without a library; `extra` is the value of ExtraSamples."""

    def write(path, pixels, orientation=1):
        height, width, channels = pixels.shape
        data = pixels.astype(f"{order}u2").tobytes()
        longs = {256: width, 257: height, 273: 8, 278: height, 279: len(data)}
        shorts = {259: 1, 262: 2, 274: orientation, 277: channels} | ({} if extra is None else {338: extra})
        entries = {tag: struct.pack(f"{order}HHII", tag, 4, 1, value) for tag, value in longs.items()}
        entries |= {tag: struct.pack(f"{order}HHIHH", tag, 3, 1, value, 0) for tag, value in shorts.items()}
        entries[258] = struct.pack(f"{order}HHII", 258, 3, channels, 8 + len(data))  # bits of each channel
        bits = struct.pack(f"{order}{channels}H", *[16] * channels)
        head = (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(f"{order}I", 8 + len(data) + len(bits))
        directory = struct.pack(f"{order}H", len(entries)) + b"".join(entries[tag] for tag in sorted(entries))
        path.write_bytes(head + data + bits + directory + bytes(4))

    return write


def exr(channels):
    return lambda path, pixels, orientation=1: OpenEXR.File({}, {channels: pixels}).write(str(path))


RGB, RGBA = random_bytes(5, 7, 3), random_bytes(5, 7, 4)
DEEP_RGBA = np.random.default_rng(5).integers(0, 65536, (5, 7, 4), np.uint16)
DEEP = DEEP_RGBA[..., :3].copy()
LIGHT = np.random.default_rng(6).random((5, 7, 3), np.float32)
BLOCK = np.pad(np.full((8, 8), 255, np.uint8), ((0, 8), (0, 24)))  # aligned to blocks, so that JPEG keeps it
TURNED = {  # kinds with an orientation: file name, writer, and stored pixels
    "RGB": ("a.png", by_pillow, RGB),
    "RGBA": ("a.png", by_pillow, RGBA),
    "gray": ("a.png", by_pillow, RGB[..., 0]),
    "JPEG": ("a.jpg", by_pillow, np.dstack([BLOCK] * 3)),
    "gray JPEG": ("a.jpg", by_pillow, BLOCK),
    "TIFF": ("a.tif", tiff_by_pillow, RGB),
    "deep": ("a.png", png, DEEP),
    "deep with alpha": ("a.png", png, DEEP_RGBA),
    "deep gray with alpha": ("a.png", png, DEEP_RGBA[..., 2:]),
    "deep TIFF, little endian": ("a.tif", tiff("<"), DEEP),
    "deep TIFF, big endian": ("a.tif", tiff(">"), DEEP),
    "deep TIFF with alpha": ("a.tif", tiff(extra=2), DEEP_RGBA),
}
UPRIGHT = {
    "deep gray": ("a.png", by_opencv, DEEP[..., 0]),
    "deep TIFF by OpenCV": ("a.tif", by_opencv, DEEP_RGBA),
    "deep gray TIFF, little endian": ("a.tif", gray_tiff("<"), DEEP[..., 0]),
    "deep gray TIFF, big endian": ("a.tif", gray_tiff(">"), DEEP[..., 0]),
    "float TIFF": ("a.tif", by_opencv, LIGHT),
    "EXR": ("a.exr", exr("RGB"), LIGHT),
    "half EXR": ("a.exr", exr("RGB"), LIGHT.astype(np.float16)),
    "gray EXR": ("a.exr", exr("Y"), LIGHT[..., 0].copy()),
    "bitmap of 24 bits": ("a.bmp", bitmap("RGB"), RGB),
    "bitmap of 8 bits": ("a.bmp", bitmap("P"), RGB // 255 * 255),
    "bitmap of 1 bit": ("a.bmp", bitmap("1"), RGB[..., 0] // 255 * 255),
}


def displayed(name, pixels):
    """Stored pixels as colors in [0, 1] with their alpha, and the tolerance of this kind of file."""
    tolerance = {"a.jpg": 0.05, "a.exr": 1e-3 if pixels.dtype == np.float16 else 1e-6}.get(name, 1e-7)
    if pixels.dtype.kind == "u":
        pixels = pixels / np.iinfo(pixels.dtype).max
    elif name == "a.exr":
        pixels = linear_to_srgb(pixels.astype(np.float64))
    if pixels.ndim == 2:
        return np.dstack([pixels] * 3), tolerance
    return pixels[..., [0, 0, 0, 1]] if pixels.shape[2] == 2 else pixels, tolerance


def turned(pixels, orientation):
    """Pixels as displayed for an orientation of Exif 2.3."""
    turns = {1: 0, 2: 0, 3: 2, 4: 2, 5: 3, 6: 3, 7: 1, 8: 1}[orientation]
    pixels = np.rot90(pixels, turns)
    return pixels[:, ::-1] if orientation in (2, 4, 5, 7) else pixels


@pytest.mark.opens(
    "photo",
    "cameras, scanners, editors",
    "PNG, JPEG, WebP, TIFF, BMP",
    "8 and 16 bits, gray, palettes, alpha, Exif orientation",
)
@pytest.mark.opens("photo", "renderers, compositors", "OpenEXR", "linear light; data and display window")
@pytest.mark.parametrize("kind", [*TURNED, *UPRIGHT])
def test_every_kind_is_read_upright_and_as_stored(tmp_path, kind):
    name, write, pixels = (TURNED | UPRIGHT)[kind]
    colors, tolerance = displayed(name, pixels)
    for orientation in range(1, 9) if kind in TURNED else [1]:
        write(tmp_path / name, pixels, orientation)
        upright, stored = read_photo(tmp_path / name), read_photo(tmp_path / name, upright=False)
        header = image_header(tmp_path / name)
        assert upright.dtype == np.float32
        assert_allclose(upright, turned(colors, orientation), atol=tolerance)
        assert_allclose(stored, colors, atol=tolerance)
        assert image_size(tmp_path / name) == header.display_size == upright.shape[1::-1]
        assert header.stored_size == stored.shape[1::-1]
        assert header.deep == (name == "a.exr" or (pixels.dtype != np.uint8 and pixels.ndim == 3))


@pytest.mark.parametrize("options", [{"lossless": True}, {"lossless": False}, {"exif": b"Exif\0\0"}])
@pytest.mark.parametrize("channels", [3, 4])
def test_size_of_webp_is_read_for_every_chunk_type(tmp_path, options, channels):
    Image.fromarray(random_bytes(21, 37, channels)).save(tmp_path / "a.webp", **options)
    assert image_size(tmp_path / "a.webp") == read_photo(tmp_path / "a.webp").shape[1::-1] == (37, 21)


def test_size_is_read_from_rare_headers(tmp_path):
    (tmp_path / "progressive.jpg").write_bytes(jpeg_head(300, 200, orientation=5))  # with a fill byte
    header = image_header(tmp_path / "progressive.jpg")
    assert (header.stored_size, header.display_size) == ((300, 200), (200, 300))
    bitmap("RGB")(tmp_path / "top_down.bmp", RGB)
    data = bytearray((tmp_path / "top_down.bmp").read_bytes())
    struct.pack_into("<i", data, 22, -5)
    (tmp_path / "top_down.bmp").write_bytes(data)
    assert image_size(tmp_path / "top_down.bmp") == (7, 5)


def test_palette_pictures_become_rgb_and_keep_transparency(tmp_path):
    palette = Image.fromarray(np.array([[0, 1]], np.uint8)).convert("P")
    palette.putpalette([255, 0, 0, 0, 51, 255])
    palette.save(tmp_path / "palette.png")
    assert_allclose(read_photo(tmp_path / "palette.png"), [[[1, 0, 0], [0, 0.2, 1]]])
    palette.save(tmp_path / "transparent.png", transparency=0)
    assert_allclose(read_photo(tmp_path / "transparent.png"), [[[1, 0, 0, 0], [0, 0.2, 1, 1]]])


def test_premultiplied_alpha_is_removed(tmp_path):
    pixels = np.array([[[20000, 10000, 0, 40000], [7, 7, 7, 0]]], np.uint16)
    tiff(extra=1)(tmp_path / "a.tif", pixels)
    assert_allclose(read_photo(tmp_path / "a.tif"), [[[0.5, 0.25, 0, 40000 / 65535], [0, 0, 0, 0]]], atol=1e-6)
    light = np.array([[[0.25, 0.125, 0, 0.5], [0, 0, 0, 0], [1, 0.5, 0.25, 1]]], np.float32)
    exr("ViewLayer.Combined")(tmp_path / "a.exr", light)
    straight = linear_to_srgb(np.array([[[0.5, 0.25, 0], [0, 0, 0], [1, 0.5, 0.25]]]))
    assert_allclose(read_photo(tmp_path / "a.exr"), np.dstack([straight, light[..., 3:]]), atol=1e-6)


@pytest.mark.parametrize(("kind", "tolerance"), [(np.float16, 1e-3), (np.float32, 1e-6)])
def test_linear_light_beyond_display_range_is_clipped(tmp_path, kind, tolerance):
    light = np.array([[[0, 0.002, 0.18], [0.5, 1, 30]], [[np.nan, -1, np.inf], [0.25, 0.25, 0.25]]], kind)
    exr("RGB")(tmp_path / "a.exr", light)
    photo = read_photo(tmp_path / "a.exr")
    expected = linear_to_srgb(np.array([[[0, 0.002, 0.18], [0.5, 1, 1]], [[0, 0, 1], [0.25, 0.25, 0.25]]]))
    assert_allclose(photo, expected, atol=tolerance)
    assert_allclose(photo[0, 0, 2], 0.4614, atol=1e-3)  # middle gray


@pytest.mark.parametrize(("left", "top"), [(1, 2), (-2, -1)])
def test_exr_pictures_fill_their_display_window(tmp_path, left, top):
    light = LIGHT[:3, :4, 0].copy()
    window = {"displayWindow": ((0, 0), (5, 6)), "dataWindow": ((left, top), (left + 3, top + 2))}
    OpenEXR.File(window, {"Y": light}).write(str(tmp_path / "a.exr"))
    whole = np.zeros((20, 20))
    whole[10 + top : 13 + top, 10 + left : 14 + left] = linear_to_srgb(light)
    expected = np.repeat(whole[10:17, 10:16, None], 3, -1)
    assert_allclose(read_photo(tmp_path / "a.exr"), expected, atol=1e-6)
    assert image_size(tmp_path / "a.exr") == (6, 7)


def test_exr_without_color_channels_is_rejected(tmp_path):
    exr("Z")(tmp_path / "a.exr", np.ones((2, 2), np.float32))
    with pytest.raises(DataError, match=r"a\.exr cannot be read as a picture: it has no colors among its channels Z"):
        read_photo(tmp_path / "a.exr")


@pytest.mark.parametrize("pixels", [RGB, RGBA], ids=["RGB", "RGBA"])
def test_eight_bit_colors_survive_a_round_trip(tmp_path, pixels):
    write_png(tmp_path / "a.png", pixels)
    photo = read_photo(tmp_path / "a.png")
    assert_array_equal(photo, pixels.astype(np.float32) / 255)
    write_png(tmp_path / "b.png", photo)
    assert (tmp_path / "b.png").read_bytes() == (tmp_path / "a.png").read_bytes()


@pytest.mark.parametrize(
    ("array", "stored"),
    [
        (DEEP[..., 0], DEEP[..., 0]),
        (np.array([[-1.0, 0.6 / 255, 0.4 / 255, 254.6 / 255, 2.0]]), [[0, 1, 0, 255, 255]]),
        (np.array([[True, False]]), [[255, 0]]),
    ],
    ids=["deep", "floats", "bool"],
)
def test_gray_is_written_unchanged_and_floats_are_rounded_to_bytes(tmp_path, array, stored):
    write_png(tmp_path / "a.png", array)
    assert_array_equal(np.asarray(Image.open(tmp_path / "a.png")), stored)


@pytest.mark.parametrize("array", [np.zeros((2, 2), np.int64), np.zeros((2, 2, 3), np.uint16)], ids=["int64", "deep"])
def test_unsupported_arrays_are_rejected(tmp_path, array):
    with pytest.raises(TypeError):
        write_png(tmp_path / "a.png", array)
    assert not list(tmp_path.iterdir())
