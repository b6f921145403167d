"""Edited copies of photos keep format, depth, profile, metadata and the bits of unedited pixels."""

import cv2
import numpy as np
import OpenEXR
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image, ImageCms
from PIL.PngImagePlugin import PngInfo
from PIL.TiffImagePlugin import IFDRational, ImageFileDirectory_v2

from blender_tests.engine.reference.pictures import random_bytes
from karf_engine.errors import DataError
from karf_engine.io.color import linear_to_srgb, srgb_to_linear
from karf_engine.io.images import read_photo
from karf_engine.recolor.photos import open_photo, suffix_for, write_photo

PROFILE = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
ROWS, COLUMNS = slice(2, 5), slice(1, 4)
UNEDITED = np.ones((7, 5), bool)
UNEDITED[ROWS, COLUMNS] = False
REDDER = np.array([0.2, -0.1, 0.0], np.float32)
ZIP, DWAA = OpenEXR.ZIP_COMPRESSION, OpenEXR.DWAA_COMPRESSION


def random_words(*shape):
    return np.random.default_rng(5).integers(0, 65536, size=shape, dtype=np.uint16)


def exif(orientation=1):
    tags = Image.Exif()
    tags[0x0112], tags[0x010F] = orientation, "Camera"
    tags[0x8769] = {0x829A: IFDRational(1, 125)}  # exposure time
    return tags


def write_tiff(path, pixels, orientation=1, is_premultiplied=False):
    """Write an uncompressed TIFF with profile, resolution and Exif."""
    height, width, channels = pixels.shape
    tags = ImageFileDirectory_v2()
    values = {
        256: width, 257: height, 258: (8 * pixels.itemsize,) * channels, 259: 1, 262: 2, 271: "Camera", 273: (0,),
        274: orientation, 277: channels, 278: height, 279: (pixels.nbytes,), 282: 300.0, 283: 300.0, 296: 2,
        34675: PROFILE, 34665: {0x829A: IFDRational(1, 125)},
        **({338: (1 if is_premultiplied else 2,)} if channels == 4 else {}),
    }  # fmt: skip
    tags.tagtype[34665] = tags.tagtype[273] = tags.tagtype[279] = 4
    for tag, value in values.items():
        tags[tag] = value
    with path.open("wb") as file:
        tags.save(file)
        file.write(pixels.tobytes())


def save_sample(path, orientation=1):
    """Write a photo of the kind named by the file, with metadata if the kind supports it."""
    name, suffix = path.stem, path.suffix
    facts = {"exif": exif(orientation).tobytes(), "icc_profile": PROFILE, "dpi": (300, 300)}
    if name == "deep" and suffix == ".png":
        exif_bytes, profile = (np.frombuffer(data, np.uint8) for data in (exif(orientation).tobytes()[6:], PROFILE))
        cv2.imwriteWithMetadata(str(path), random_words(7, 5, 3), [0, 2], [exif_bytes[None], profile[None]])
    elif name == "deep_alpha" and suffix == ".png":
        cv2.imwrite(str(path), random_words(7, 5, 4))
    elif name.startswith("deep"):
        write_tiff(path, random_words(7, 5, 4 if "alpha" in name else 3), orientation)
    elif name == "premultiplied":
        write_tiff(path, np.tile(np.uint8([64, 64, 64, 128]), (7, 5, 1)), is_premultiplied=True)
    elif name == "float":
        cv2.imwrite(str(path), np.random.default_rng(1).random((7, 5, 3), np.float32))
    else:
        picture = Image.fromarray(random_bytes(7, 5, 4 if "alpha" in name else 3))
        mode = {"gray": "L", "palette": "P"}.get(name, picture.mode)
        picture.convert(mode).save(path, **(facts if suffix != ".bmp" else {}))


TURNED = ["plain.png", "deep.png", "plain.jpg", "plain.tif", "deep.tif"]
SAMPLES = [
    *TURNED, "alpha.png", "gray.png", "palette.png", "deep_alpha.png", "plain.webp", "plain.bmp", "alpha.tif",
    "deep_alpha.tif", "premultiplied.tif", "float.tif",
]  # fmt: skip


def edited_copy(path):
    """The path of a photo's copy with some reddened pixels, and the photo."""
    photo = open_photo(path)
    copy = photo.copy()
    copy.change(ROWS, COLUMNS, np.broadcast_to(REDDER, (3, 3, 3)).copy())
    result = path.with_name(f"edited{suffix_for(photo)}")
    write_photo(result, copy)
    return result, photo


@pytest.mark.parametrize(
    ("name", "orientation"),
    [*((name, 1) for name in SAMPLES), *((name, turn) for name in TURNED for turn in range(2, 9))],
)
def test_copy_replaces_its_photo_and_unedited_pixels_keep_their_bits(tmp_path, name, orientation):
    save_sample(tmp_path / name, orientation)
    result, photo = edited_copy(tmp_path / name)
    again = open_photo(result)
    assert result.suffix == (".tif" if name.endswith("tif") else ".png")
    assert again.pixels.dtype == photo.pixels.dtype and again.size == photo.size == (5, 7)
    assert again.header.orientation == photo.header.orientation == orientation
    assert_array_equal(again.pixels[UNEDITED], photo.pixels[UNEDITED])
    assert_array_equal(again.pixels[..., 3:], photo.pixels[..., 3:])
    expected = np.clip(photo.colors(ROWS, COLUMNS) + REDDER, 0, 1)
    steps = 65535 if photo.pixels.dtype == np.uint16 else 255
    assert_allclose(again.colors(ROWS, COLUMNS), expected, atol=0.51 / steps)
    assert_allclose(photo.colors(), read_photo(tmp_path / name, upright=False)[..., :3], atol=1e-7)
    assert name != "premultiplied.tif" or np.allclose(photo.colors(), 0.5, atol=0.01)
    changed = read_photo(result) - read_photo(tmp_path / name)  # upright
    assert changed.shape[:2] == ((5, 7) if orientation >= 5 else (7, 5)) and changed.any()


@pytest.mark.parametrize("name", [*TURNED, "plain.webp"])
def test_profile_exif_and_resolution_are_kept(tmp_path, name):
    save_sample(tmp_path / name)
    with Image.open(edited_copy(tmp_path / name)[0]) as file:
        assert file.info["icc_profile"] == PROFILE
        tags = file.getexif()
        assert tags[0x010F] == "Camera" and float(tags.get_ifd(0x8769)[0x829A]) == pytest.approx(1 / 125)
        if name not in ("deep.png", "plain.webp"):  # whose samples have none
            assert_allclose(np.array(file.info["dpi"], float), 300, atol=0.1)


def test_texts_are_kept_and_a_gray_profile_is_dropped(tmp_path):
    texts = PngInfo()
    texts.add_text("Author", "someone")
    gray = bytearray(PROFILE)
    gray[16:20] = b"GRAY"
    Image.fromarray(random_bytes(7, 5)).save(tmp_path / "gray.png", pnginfo=texts, icc_profile=bytes(gray))
    with Image.open(edited_copy(tmp_path / "gray.png")[0]) as file:
        assert file.mode == "RGB" and file.info["Author"] == "someone" and "icc_profile" not in file.info
    Image.fromarray(random_bytes(7, 5, 3)).save(tmp_path / "a.jpg", xmp=b"<x:xmpmeta/>", icc_profile=PROFILE)
    with Image.open(edited_copy(tmp_path / "a.jpg")[0]) as file:
        file.load()
        assert b"xmpmeta" in file.info["xmp"]


def test_jpeg_is_kept_on_request(tmp_path):
    noise = np.kron(random_bytes(2, 2, 3), np.ones((8, 8, 1), np.uint8))
    Image.fromarray(noise).save(tmp_path / "a.jpg", subsampling=2, quality=80, exif=exif(6), icc_profile=PROFILE)
    photo = open_photo(tmp_path / "a.jpg")
    assert suffix_for(photo, jpeg=True) == ".jpg"
    write_photo(tmp_path / "b.jpg", photo)
    with Image.open(tmp_path / "b.jpg") as file:
        assert file.format == "JPEG" and file.info["icc_profile"] == PROFILE and file.getexif()[0x0112] == 6
        assert file.layer[0][1:3] == (2, 2)
    assert np.abs(open_photo(tmp_path / "b.jpg").pixels.astype(int) - photo.pixels).max() < 20


def random_light(*shape):
    return np.random.default_rng(3).random(shape, np.float32) * 1.5


def write_exr(path, channels, **header):
    OpenEXR.File({"compression": ZIP, "type": OpenEXR.scanlineimage} | header, channels).write(str(path))


@pytest.mark.parametrize(
    ("channels", "kind", "compression"),
    [
        *(("RGB", kind, compression) for kind in (np.float16, np.float32) for compression in (ZIP, DWAA)),
        *((channels, np.float32, ZIP) for channels in ("RGBA", "Y")),
    ],
)
def test_exr_is_edited_as_displayed_and_keeps_its_depth(tmp_path, channels, kind, compression):
    pixels = random_light(7, 5, len(channels)).astype(kind)
    pixels[0, 0], pixels[0, 1], pixels[..., 3:] = np.inf, -0.5, 0.25
    stored = {channels: pixels if len(channels) > 1 else pixels[..., 0], "Z": random_light(7, 5)}
    write_exr(tmp_path / "a.exr", stored, compression=compression, owner="me")
    result, photo = edited_copy(tmp_path / "a.exr")
    written, before = OpenEXR.File(str(result)), photo.pixels
    if channels == "Y":  # luminance becomes colors
        channels, before = "RGB", np.repeat(photo.pixels, 3, -1)
    again = written.channels()[channels].pixels
    assert set(written.channels()) == {channels, "Z"}
    assert again.dtype == kind and written.header()["owner"] == "me"
    assert again[UNEDITED].tobytes() == before[UNEDITED].tobytes()
    assert_array_equal(again[..., 3:], before[..., 3:])
    alpha = 0.25 if channels == "RGBA" else 1.0
    straight = before[ROWS, COLUMNS, :3].astype(float) / alpha
    displayed = np.clip(straight, 0, 1)
    expected = srgb_to_linear(np.clip(linear_to_srgb(displayed) + REDDER, 0, 1)) + straight - displayed
    assert_allclose(again[ROWS, COLUMNS, :3], expected * alpha, atol=2e-3 if kind == np.float16 else 1e-5)
    assert_array_equal(written.channels()["Z"].pixels, OpenEXR.File(str(photo.path)).channels()["Z"].pixels)


def test_data_window_of_an_exr_is_kept(tmp_path):
    pixels, (data, display) = random_light(8, 7, 3), np.int32([[[1, 2], [7, 9]], [[0, 0], [9, 11]]])
    write_exr(tmp_path / "a.exr", {"RGB": pixels}, dataWindow=tuple(data), displayWindow=tuple(display))
    result, photo = edited_copy(tmp_path / "a.exr")
    assert photo.size == (10, 12)
    again = OpenEXR.File(str(result))
    assert again.header()["dataWindow"][0].tolist() == [1, 2]
    assert_array_equal(again.channels()["RGB"].pixels[3:], pixels[3:])
    assert (again.channels()["RGB"].pixels[:3, :3] != pixels[:3, :3]).any()


@pytest.mark.parametrize("name", ["alpha.png", "deep.tif", "plain.jpg"])
def test_resizing_keeps_the_depth_and_never_enlarges(tmp_path, name):
    save_sample(tmp_path / name)
    photo = open_photo(tmp_path / name)
    small = photo.resized(4)
    assert small.size == (3, 4) and small.pixels.dtype == photo.pixels.dtype
    assert photo.resized(9) is photo
    write_photo(tmp_path / f"small{suffix_for(photo)}", small)
    assert_array_equal(open_photo(tmp_path / f"small{suffix_for(photo)}").pixels, small.pixels)


@pytest.mark.parametrize("name", ["a.png", "missing.jpg"])
def test_unreadable_photos_are_rejected(tmp_path, name):
    (tmp_path / "a.png").write_bytes(b"no picture")
    with pytest.raises(DataError, match=name):
        open_photo(tmp_path / name)
