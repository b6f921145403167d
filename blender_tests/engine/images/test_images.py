"""Image files, masks, resizing, undistortion and working-size plates, against hand arithmetic."""

import struct

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

Image = pytest.importorskip("PIL.Image")
cv2 = pytest.importorskip("cv2")
iio = pytest.importorskip("imageio.v3")
OpenEXR = pytest.importorskip("OpenEXR")
pytest.importorskip("scipy")

from karf_engine import plates
from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import View
from karf_engine.capture.image_size import image_header, image_size
from karf_engine.color import linear_to_srgb
from karf_engine.errors import DataError
from karf_engine.images import read_mask, read_photo, resize, write_png
from karf_engine.plates import background_kind, lens_map, load_views, undistort


def random_bytes(*shape):
    return np.random.default_rng(0).integers(0, 256, size=shape, dtype=np.uint8)


# ---------------------------------------------------------------------------------------------------------------- files
@pytest.mark.parametrize("channels", [3, 4])
def test_eight_bit_colors_survive_a_round_trip(tmp_path, channels):
    pixels = random_bytes(5, 7, channels)
    write_png(tmp_path / "a.png", pixels)
    photo = read_photo(tmp_path / "a.png")
    assert photo.dtype == np.float32
    assert_array_equal(photo, pixels.astype(np.float32) / 255)
    write_png(tmp_path / "b.png", photo)
    assert (tmp_path / "b.png").read_bytes() == (tmp_path / "a.png").read_bytes()


def test_floats_are_clipped_and_rounded_to_the_nearest_byte(tmp_path):
    write_png(tmp_path / "a.png", np.array([[-1.0, 0.6 / 255, 0.4 / 255, 254.6 / 255, 2.0]]))
    assert_array_equal(np.asarray(Image.open(tmp_path / "a.png")), [[0, 1, 0, 255, 255]])


def test_sixteen_bit_gray_survives_a_round_trip(tmp_path):
    depth = np.array([[0, 1, 1000], [40000, 65534, 65535]], np.uint16)
    write_png(tmp_path / "a.png", depth)
    photo = read_photo(tmp_path / "a.png")
    assert photo.shape == (2, 3, 3)
    assert_array_equal(np.rint(photo[..., 1] * 65535).astype(np.uint16), depth)


def test_arrays_that_are_no_picture_are_refused(tmp_path):
    for array in (np.zeros((2, 2), np.int64), np.zeros((2, 2, 3), np.uint16)):
        with pytest.raises(TypeError):
            write_png(tmp_path / "a.png", array)
    assert not list(tmp_path.iterdir())


def test_gray_palette_and_transparent_palette_pictures_become_rgb(tmp_path):
    Image.fromarray(np.array([[0, 51]], np.uint8)).save(tmp_path / "gray.png")
    assert_allclose(read_photo(tmp_path / "gray.png"), [[[0, 0, 0], [0.2, 0.2, 0.2]]])

    palette = Image.fromarray(np.array([[0, 1]], np.uint8)).convert("P")
    palette.putpalette([255, 0, 0, 0, 51, 255])
    palette.save(tmp_path / "palette.png")
    assert_allclose(read_photo(tmp_path / "palette.png"), [[[1, 0, 0], [0, 0.2, 1]]])
    palette.save(tmp_path / "transparent.png", transparency=0)
    assert_allclose(read_photo(tmp_path / "transparent.png"), [[[1, 0, 0, 0], [0, 0.2, 1, 1]]])


@pytest.mark.parametrize(("orientation", "turn"), [(1, 0), (3, 2), (6, 3), (8, 1)])
def test_exif_orientation_is_applied_and_agrees_with_the_header_size(tmp_path, orientation, turn):
    pixels = np.zeros((16, 32, 3), np.uint8)
    pixels[:8, :8] = 255
    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.fromarray(pixels).save(tmp_path / "a.jpg", exif=exif, quality=100)
    photo = read_photo(tmp_path / "a.jpg")
    assert_allclose(photo, np.rot90(pixels / 255, turn), atol=0.05)
    assert image_size(tmp_path / "a.jpg") == photo.shape[1::-1]
    assert read_photo(tmp_path / "a.jpg", upright=False).shape == (16, 32, 3)


@pytest.mark.parametrize("mode", ["L", "RGB"])
def test_mirrored_photos_are_turned_back_gray_or_colored(tmp_path, mode):
    pixels = np.zeros((16, 32), np.uint8)
    pixels[:8, :8] = 255
    exif = Image.Exif()
    for orientation, expected in ((2, pixels[:, ::-1]), (4, pixels[::-1]), (5, pixels.T), (7, pixels[::-1, ::-1].T)):
        exif[0x0112] = orientation
        Image.fromarray(pixels).convert(mode).save(tmp_path / "a.jpg", exif=exif, quality=100)
        assert_allclose(read_photo(tmp_path / "a.jpg")[..., 1], expected / 255, atol=0.05)


@pytest.mark.parametrize("options", [{"lossless": True}, {"lossless": False}, {"exif": b"Exif\0\0"}])
@pytest.mark.parametrize("channels", [3, 4])
def test_webp_header_sizes_agree_with_the_pixels(tmp_path, options, channels):
    Image.fromarray(random_bytes(21, 37, channels)).save(tmp_path / "a.webp", **options)
    assert image_size(tmp_path / "a.webp") == (37, 21)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "is empty"),
        (b"version https://git-lfs.github.com/spec/v1\n", "Git-LFS pointer"),
        (b"hello, no picture", "cannot be read as a picture"),
    ],
)
def test_unreadable_photos_are_named_with_the_reason(tmp_path, data, words):
    path = tmp_path / "a.png"
    path.write_bytes(data)
    with pytest.raises(DataError) as caught:
        read_photo(path)
    assert words in caught.value.sentence and str(path) in caught.value.sentence


def test_truncated_and_missing_photos_are_named(tmp_path):
    path = tmp_path / "a.png"
    write_png(path, random_bytes(50, 50, 3))
    path.write_bytes(path.read_bytes()[:3000])
    with pytest.raises(DataError, match=r"a\.png cannot be read as a picture: .*truncated"):
        read_photo(path)
    with pytest.raises(DataError, match=r"b\.png does not exist"):
        read_photo(tmp_path / "b.png")
    with pytest.raises(DataError, match="is a folder, not a file"):
        read_photo(tmp_path)


# ----------------------------------------------------------------------------------------------------------- deep color
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
        assert image_header(path).shown == expected.shape[1::-1] and image_header(path).stored == (7, 5)


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
        assert image_header(path).shown == expected.shape[1::-1] and image_header(path).stored == (7, 5)


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


# ---------------------------------------------------------------------------------------------------------------- masks
SHAPE = np.array([[True, False, False], [True, True, False]])


def rgba(color, alpha):
    return np.dstack([np.broadcast_to(color, (2, 3)).astype(np.uint8)] * 3 + [np.broadcast_to(alpha, (2, 3))])


@pytest.mark.parametrize(
    "pixels",
    [
        SHAPE,
        SHAPE * np.uint8(255),
        np.where(SHAPE, 128, 127).astype(np.uint8),
        SHAPE.astype(np.uint8),
        SHAPE * np.uint16(40000),
        np.dstack([SHAPE * np.uint8(255), np.zeros((2, 3, 2), np.uint8)]),
        rgba(255, np.uint8(SHAPE * 255)),
        rgba(0, np.uint8(SHAPE * 255)),
        rgba([[9, 99, 200], [200, 9, 9]], np.uint8(SHAPE * 255)),
        rgba(SHAPE * 255, np.uint8(255)),
    ],
    ids=["bool", "gray", "half", "labels", "16-bit", "red", "white matte", "black matte", "cut-out", "opaque"],
)
def test_masks_of_any_kind_give_the_same_shape(tmp_path, pixels):
    write_png(tmp_path / "m.png", pixels)
    assert_array_equal(read_mask(tmp_path / "m.png"), SHAPE)


@pytest.mark.parametrize(
    ("pixels", "inside"),
    [
        (rgba(0, np.uint8(255)), False),
        (rgba(255, np.uint8(0)), False),
        (rgba(255, np.uint8(255)), True),
        (np.zeros((2, 3), np.uint8), False),
        (np.full((2, 3), 255, np.uint8), True),
    ],
)
def test_masks_without_a_border_are_all_or_nothing(tmp_path, pixels, inside):
    write_png(tmp_path / "m.png", pixels)
    assert_array_equal(read_mask(tmp_path / "m.png"), np.full((2, 3), inside))


# ------------------------------------------------------------------------------------------------------------- resizing
def test_shrinking_averages_areas_also_at_broken_factors():
    row = np.array([[0.0, 3.0, 6.0]])  # three pixels to two: 1 + 1/2 pixels each
    assert_allclose(resize(row, 2, 1), [[(0 + 3 / 2) / 1.5, (3 / 2 + 6) / 1.5]])
    image = np.random.default_rng(1).random((6, 8, 3))
    assert_allclose(resize(image, 4, 2), image.reshape(2, 3, 4, 2, 3).mean((1, 3)), atol=1e-6)


def test_enlarging_interpolates_between_pixel_centers():
    assert_allclose(resize(np.array([[0.0, 1.0]]), 4, 2), [[0, 0.25, 0.75, 1.0]] * 2)


def test_resizing_to_the_same_size_changes_nothing():
    image = np.random.default_rng(2).random((3, 5, 3)).astype(np.float32)
    assert_array_equal(resize(image, 5, 3), image)


# --------------------------------------------------------------------------------------------------------- undistortion
LENS = (-0.12, 0.05, 0.011, -0.0095, 0.01)


def distorted_pixel(camera, point):
    """OpenCV's documented model, written out for one point in camera axes (x right, y up, looking down -z)."""
    k1, k2, p1, p2, k3 = camera.distortion
    x, y = point[0] / -point[2], -point[1] / -point[2]
    r2 = x**2 + y**2
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    distorted_x = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
    distorted_y = y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y
    return camera.fx * distorted_x + camera.cx, camera.fy * distorted_y + camera.cy


def test_dots_photographed_through_the_lens_land_where_the_pinhole_says():
    camera = Camera(160, 120, 130.0, 120.0, 83.0, 57.0, np.eye(4), LENS)
    v, u = np.mgrid[0:120, 0:160] + 0.5
    points = [np.array([x, y, -2.0]) for x in np.linspace(-0.9, 0.9, 5) for y in np.linspace(-0.7, 0.7, 4)]
    photo = np.zeros((120, 160, 1))
    for point in points:
        dot_u, dot_v = distorted_pixel(camera, point)
        photo[..., 0] += np.exp(-((u - dot_u) ** 2 + (v - dot_v) ** 2) / (2 * 1.5**2))
    plate, pinhole, valid = undistort(photo, camera)
    expected, _ = pinhole.project(np.array(points))
    moved = [np.hypot(*(np.array(distorted_pixel(camera, p)) - e)) for p, e in zip(points, expected, strict=True)]
    assert max(moved) > 3  # the lens really bends
    for target in expected:
        near = np.hypot(u - target[0], v - target[1]) < 6
        assert valid[near].all()
        weights = plate[near, 0] / plate[near, 0].sum()
        assert_allclose([weights @ u[near], weights @ v[near]], target, atol=0.05)


def test_undistortion_looks_up_the_photo_at_the_distorted_position():
    camera = Camera(160, 120, 130.0, 120.0, 83.0, 57.0, np.eye(4), LENS)
    v, u = np.mgrid[0:120, 0:160] + 0.5
    plate, pinhole, valid = undistort(np.dstack([u, v, 0 * u]), camera)  # the photo shows its own coordinates
    assert (pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy) == (130.0, 120.0, 83.0, 57.0)
    assert (pinhole.width, pinhole.height, pinhole.distortion) == (160, 120, ())
    for row, column in ((0, 0), (60, 80), (33, 150), (119, 159), (100, 5)):
        local = [(column + 0.5 - 83.0) / 130.0, (57.0 - row - 0.5) / 120.0, -1.0]
        looked_up = distorted_pixel(camera, np.array(local))
        inside = 0 <= looked_up[0] <= 160 and 0 <= looked_up[1] <= 120
        assert valid[row, column] == inside
        if inside:
            assert_allclose(plate[row, column, :2], np.clip(looked_up, 0.5, [159.5, 119.5]), atol=1e-4)


def test_pixels_beyond_the_fold_of_the_lens_model_are_invalid():
    camera = Camera(100, 100, 40.0, 40.0, 50.0, 50.0, np.eye(4), (-0.4, 0.0, 0.0, 0.0))
    _, _, valid = undistort(np.zeros((100, 100, 3)), camera)
    fold = 40.0 / np.sqrt(3 * 0.4)  # d/dr (r - 0.4 r^3) = 0
    radius = np.hypot(*(np.mgrid[0:100, 0:100] - 49.5))
    assert_array_equal(valid, radius < fold)


def test_a_lens_without_distortion_leaves_the_photo_alone():
    camera = Camera(4, 3, 5.0, 5.0, 2.0, 1.5, np.eye(4), (0.0, 0.0, 0.0, 0.0))
    photo = np.random.default_rng(3).random((3, 4, 3))
    plate, pinhole, valid = undistort(photo, camera)
    assert_array_equal(plate, photo)
    assert pinhole.distortion == () and valid.all()


LENSES = {
    "OPENCV": (LENS, False),
    "barrel": ((-0.25, 0.06, 0.0, 0.0), False),
    "rational": ((0.3, -0.1, 0.001, 0.002, 0.01, 0.5, -0.1, 0.02), False),
    "fisheye": ((-0.02, 0.01, -0.004, 0.001), True),
}


def opencv_map(camera):
    """OpenCV's own undistortion map; its pixel centers lie at integers."""
    matrix = np.array([[camera.fx, 0, camera.cx - 0.5], [0, camera.fy, camera.cy - 0.5], [0, 0, 1]])
    size, coefficients = (camera.width, camera.height), np.array(camera.distortion)
    make = cv2.fisheye.initUndistortRectifyMap if camera.fisheye else cv2.initUndistortRectifyMap
    return make(matrix, coefficients, np.eye(3), matrix, size, cv2.CV_32FC1)


@pytest.mark.parametrize("name", LENSES)
def test_every_lens_is_undistorted_as_opencv_does(name):
    camera = Camera(320, 240, 210.0, 205.0, 166.0, 115.0, np.eye(4), *LENSES[name])
    map_u, map_v = opencv_map(camera)
    assert (
        max(np.abs(map_u - np.arange(320)).max(), np.abs(map_v.T - np.arange(240)).max()) > 3
    )  # the lens really bends
    photo = cv2.GaussianBlur(np.random.default_rng(9).random((240, 320, 3), np.float32), (0, 0), 1.5)
    straight, _, valid = undistort(photo, camera)
    expected = cv2.remap(photo, map_u, map_v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=(9, 9, 9))
    inside = (np.minimum(map_u, map_v) >= 0) & (map_u <= 319) & (map_v <= 239)
    assert inside.mean() > 0.5
    assert_allclose(straight[inside], expected[inside], atol=1e-4)
    near = (np.minimum(map_u, map_v) >= -0.499) & (map_u <= 319.499) & (map_v <= 239.499)
    far = (np.minimum(map_u, map_v) < -0.501) | (map_u > 319.501) | (map_v > 239.501)
    assert valid[near].all() and not valid[far].any()


def test_a_lens_map_is_computed_once_for_views_that_share_it(tmp_path):
    lens_map.cache_clear()
    lens = [view_of(tmp_path / f"{i}.png", random_bytes(12, 18, 3), LENS) for i in range(5)]
    other = [view_of(tmp_path / f"b{i}.png", random_bytes(12, 18, 3), LENS[:4]) for i in range(5)]
    load_views([view for pair in zip(lens, other, strict=True) for view in pair], 9)
    assert lens_map.cache_info().misses == 2


def test_a_shrunken_photo_is_undistorted_without_loss_of_detail(tmp_path):
    camera = Camera(640, 480, 420.0, 410.0, 332.0, 230.0, np.eye(4), (0.12, 0.05, 0.011, -0.0095))
    smooth = cv2.GaussianBlur(np.random.default_rng(10).random((480, 640, 3)), (0, 0), 4)
    pixels = np.uint8(255 * (smooth - smooth.min()) / np.ptp(smooth))
    write_png(tmp_path / "a.png", pixels)
    (plate,) = load_views([View("a", "a", camera, tmp_path / "a.png", "train")], 100)
    straight, _, valid = undistort(pixels / 255, camera)
    seen = resize(valid.astype(float), 100, 75) > 0.999
    difference = np.abs(plate.color - resize(straight, 100, 75))[seen & plate.valid]
    assert difference.max() < 0.03 and np.sqrt((difference**2).mean()) < 0.004
    assert (seen != plate.valid).mean() < 0.02


# --------------------------------------------------------------------------------------------------------------- plates
def view_of(path, pixels, distortion=(), size=None):
    write_png(path, pixels)
    width, height = size or pixels.shape[1::-1]
    return View(path.stem, path.stem, Camera(width, height, 20.0, 22.0, 9.0, 6.0, np.eye(4), distortion), path, "train")


def test_plates_shrink_to_the_long_side_with_their_camera(tmp_path):
    pixels = random_bytes(12, 18, 3)
    (plate,) = load_views([view_of(tmp_path / "a.png", pixels)], 9)
    assert plate.color.shape == (6, 9, 3) and plate.color.dtype == np.float32
    assert_allclose(plate.color, pixels.reshape(6, 2, 9, 2, 3).mean((1, 3)) / 255, atol=1e-6)
    camera = plate.camera
    assert (camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy) == (9, 6, 10, 11, 4.5, 3)
    assert plate.alpha is None and plate.valid is None


def test_plates_are_never_enlarged_and_then_keep_every_stored_color(tmp_path):
    pixels = random_bytes(12, 18, 4)
    (plate,) = load_views([view_of(tmp_path / "a.png", pixels)], 400)
    assert_array_equal(plate.color, pixels[..., :3].astype(np.float32) / 255)
    assert_array_equal(plate.alpha, pixels[..., 3].astype(np.float32) / 255)


def test_hidden_colors_do_not_bleed_into_shrunken_plates(tmp_path):
    pixels = np.zeros((2, 4, 4), np.uint8)
    pixels[:, 0] = [255, 51, 0, 255]  # orange and opaque beside green and fully transparent
    pixels[:, 1:] = [0, 255, 0, 0]
    (plate,) = load_views([view_of(tmp_path / "a.png", pixels)], 2)
    assert_allclose(plate.alpha, [[0.5, 0.0]])
    assert_allclose(plate.color[0, 0], [1.0, 0.2, 0.0], atol=1e-6)


def test_an_alpha_of_255_everywhere_is_no_matte(tmp_path):
    pixels = random_bytes(12, 18, 4)
    pixels[..., 3] = 255
    (plate,) = load_views([view_of(tmp_path / "a.png", pixels)], 9)
    assert plate.alpha is None and plate.color.shape == (6, 9, 3)


def test_undistorted_plates_tell_which_pixels_the_photo_covers(tmp_path):
    view = view_of(tmp_path / "a.png", random_bytes(12, 18, 3), distortion=(0.5, 0.0, 0.0, 0.0))
    (plate,) = load_views([view], 9)
    assert plate.camera.distortion == ()
    assert plate.valid.shape == (6, 9) and plate.valid[3, 4] and not plate.valid[0, 0]


@pytest.mark.parametrize(("size", "turn"), [((16, 32), 3), ((32, 16), 0)])
def test_turned_photos_are_loaded_as_their_camera_was_made(tmp_path, size, turn):
    pixels = np.zeros((16, 32, 3), np.uint8)
    pixels[:8, :8] = 255
    exif = Image.Exif()
    exif[0x0112] = 6
    path = tmp_path / "a.jpg"
    Image.fromarray(pixels).save(path, exif=exif, quality=100)
    camera = Camera(*size, 20.0, 20.0, size[0] / 2, size[1] / 2, np.eye(4))
    (plate,) = load_views([View("a", "a", camera, path, "train")], 100)
    assert_allclose(plate.color, np.rot90(pixels / 255, turn), atol=0.05)


def test_photos_that_do_not_fit_their_camera_are_named(tmp_path):
    view = view_of(tmp_path / "a.png", random_bytes(12, 18, 3), size=(20, 12))
    with pytest.raises(DataError, match=r"a\.png is 18x12 pixels where its camera has 20x12"):
        load_views([view], 9)


def test_photos_of_many_sizes_and_kinds_load_in_one_capture(tmp_path):
    views = [
        view_of(tmp_path / "a.png", random_bytes(12, 18, 3)),
        view_of(tmp_path / "b.png", random_bytes(30, 20, 4)),
        view_of(tmp_path / "c.png", random_bytes(6, 4, 3), LENS),
    ]
    light = np.full((8, 24, 3), 0.18, np.float32)
    OpenEXR.File({}, {"RGB": light}).write(str(tmp_path / "d.exr"))
    views.append(View("d", "d", Camera(24, 8, 20.0, 20.0, 12.0, 4.0, np.eye(4)), tmp_path / "d.exr", "test"))
    plates = load_views(views, 12)
    assert [plate.color.shape[1::-1] for plate in plates] == [(12, 8), (8, 12), (4, 6), (12, 4)]
    for plate in plates:
        assert (plate.camera.width, plate.camera.height) == plate.color.shape[1::-1]
    assert [plate.alpha is not None for plate in plates] == [False, True, False, False]
    assert_allclose(plates[3].color, linear_to_srgb(np.float64(0.18)), atol=1e-6)


def test_no_more_than_one_full_size_photo_is_held(tmp_path, monkeypatch):
    import gc
    import weakref

    alive, read = [], plates.read_photo

    def watched(path, upright=True):
        gc.collect()
        assert not any(reference() is not None for reference in alive)
        photo = read(path, upright)
        alive.append(weakref.ref(photo))
        return photo

    monkeypatch.setattr(plates, "read_photo", watched)
    load_views([view_of(tmp_path / f"{i}.png", random_bytes(12, 18, 3), LENS) for i in range(3)], 9)
    assert len(alive) == 3


# ----------------------------------------------------------------------------------------------------------- background
def test_backgrounds_are_told_apart():
    photo = np.random.default_rng(4).uniform(0.2, 0.8, size=(20, 30, 3))
    black, white, matte = photo.copy(), photo.copy(), np.dstack([photo, np.ones((20, 30))])
    for image, color in ((black, 0.01), (white, 0.99)):
        image[:2], image[-2:], image[:, :2], image[:, -2:] = color, color, color, color
        image[0, 10:20] = 0.5  # the object touches the border
    matte[:5, :, 3] = 0
    opaque = np.dstack([black, np.ones((20, 30))])
    assert background_kind([photo] * 3) == "opaque"
    assert background_kind([black] * 3) == "black"
    assert background_kind([opaque] * 3) == "black"
    assert background_kind([white] * 3) == "white"
    assert background_kind([matte] * 3) == "alpha"
    assert background_kind([black] * 9 + [photo]) == "black"
    assert background_kind([black] * 2 + [photo]) == "opaque"
