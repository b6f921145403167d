"""Photos of eight bits a channel in and out, their orientation, and files that are not pictures."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

pytest.importorskip("cv2")
pytest.importorskip("imageio.v3")
pytest.importorskip("OpenEXR")
Image = pytest.importorskip("PIL.Image")

from blender_tests.engine.reference.pictures import random_bytes
from karf_engine.errors import DataError
from karf_engine.io.image_size import image_size
from karf_engine.io.images import read_photo, write_png


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
