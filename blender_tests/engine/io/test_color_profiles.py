"""Photos are read in the color space that their file declares, and recolored copies keep it."""

import io
import struct

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image, ImageCms

from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import View
from karf_engine.capture.training_images import load_views
from karf_engine.io import icc
from karf_engine.io.color import to_bytes
from karf_engine.io.icc_matrix import SRGB_TO_XYZ
from karf_engine.io.images import embedded_space, read_photo
from karf_engine.metrics.images import mean_ciede2000
from karf_engine.recolor.photos import open_photo, suffix_for, write_photo

# colorants adapted to D50, and a tone curve: the published values of each space
P3 = [[0.51512, 0.29198, 0.15710], [0.24120, 0.69225, 0.06657], [-0.00105, 0.04189, 0.78407]]
PROPHOTO = [[0.79767, 0.13519, 0.03134], [0.28804, 0.71188, 0.00009], [0.0, 0.0, 0.82491]]
SRGB_CURVE = (3, 2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)
MODES = {"RGB ": "RGB", "GRAY": "L"}


def s15(*values):
    return b"".join(struct.pack(">i", round(value * 65536)) for value in values)


def parametric(kind, *values):
    return b"para\0\0\0\0" + struct.pack(">HH", kind, 0) + s15(*values)


def table(values):
    steps = np.rint(np.asarray(values) * 65535).astype(">u2")
    return b"curv\0\0\0\0" + struct.pack(">I", len(steps)) + steps.tobytes()


def text(words):
    return (
        b"mluc\0\0\0\0"
        + struct.pack(">II", 1, 12)
        + b"enUS"
        + struct.pack(">II", 2 * len(words), 28)
        + words.encode("utf-16-be")
    )


def profile(name, curve, colorants=None):
    """An ICC profile of a matrix and one tone curve, or of gray."""
    tags = {b"desc": text(name), b"cprt": text("none"), b"wtpt": b"XYZ \0\0\0\0" + s15(0.9642, 1, 0.8249)}
    if colorants is None:
        tags[b"kTRC"] = curve
    else:
        for letter, column in zip(b"rgb", np.transpose(colorants), strict=True):
            tags[bytes([letter]) + b"XYZ"] = b"XYZ \0\0\0\0" + s15(*column)
            tags[bytes([letter]) + b"TRC"] = curve
    head, body, start = b"", b"", 132 + 12 * len(tags)
    for tag, data in tags.items():
        head += tag + struct.pack(">II", start + len(body), len(data))
        body += data + bytes(-len(data) % 4)
    space = b"GRAY" if colorants is None else b"RGB "
    size = start + len(body)
    front = struct.pack(">I4sI4s4s4s12s4s", size, b"", 0x04300000, b"mntr", space, b"XYZ ", b"", b"acsp")
    front += bytes(28) + s15(0.9642, 1, 0.8249) + bytes(48)
    return front + struct.pack(">I", len(tags)) + head + body


DISPLAY_P3 = profile("Display P3", parametric(*SRGB_CURVE), P3)
PROFILES = {
    "Display P3": DISPLAY_P3,
    "ProPhoto RGB": profile("ProPhoto RGB", parametric(0, 1.8), PROPHOTO),
    "a table": profile("a table", table(np.linspace(0, 1, 1024) ** 2.2), P3),
    "a power": profile("a power", b"curv\0\0\0\0" + struct.pack(">IH", 1, 461), P3),
    "offset": profile("offset", parametric(1, 2.2, 0.9, 0.1), P3),
}
GRAY_GAMMA_18 = profile("Gray gamma 1.8", parametric(0, 1.8))


@pytest.fixture(scope="module")
def colors():
    return np.random.default_rng(1).random((40, 50, 3))


def lcms(pixels, own, inverse=False):
    """What LittleCMS makes of 8-bit pixels."""
    spaces = [ImageCms.ImageCmsProfile(io.BytesIO(own)), ImageCms.createProfile("sRGB")]
    return np.asarray(ImageCms.profileToProfile(Image.fromarray(pixels), *spaces[:: -1 if inverse else 1], 1))


@pytest.mark.parametrize("name", PROFILES)
def test_conversions_are_those_of_littlecms(name, colors):
    space, pixels = icc.profile_space(PROFILES[name]), to_bytes(colors)
    assert space.name == name and icc.profile_name(PROFILES[name]) == name
    assert_allclose(to_bytes(space.to_srgb(pixels / 255)), lcms(pixels, PROFILES[name]), atol=1.1)
    assert_allclose(to_bytes(space.from_srgb(pixels / 255)), lcms(pixels, PROFILES[name], inverse=True), atol=1.1)


def test_profiles_of_tables_are_left_to_littlecms(colors):
    space, pixels = icc.TableSpace("P3", DISPLAY_P3), to_bytes(colors)
    assert_array_equal(to_bytes(space.to_srgb(pixels / 255)), lcms(pixels, DISPLAY_P3))
    assert_array_equal(to_bytes(space.from_srgb(pixels / 255)), lcms(pixels, DISPLAY_P3, inverse=True))


@pytest.mark.parametrize(
    "data",
    [
        ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes(),
        profile("sRGB by another name", parametric(*SRGB_CURVE), SRGB_TO_XYZ),
        b"",
        b"damaged",
        DISPLAY_P3[:300],
        GRAY_GAMMA_18,
    ],
)
def test_srgb_and_damaged_profiles_change_no_bit(data, tmp_path, colors):
    for name, options in (("a.png", {}), ("b.png", {"icc_profile": data})):
        Image.fromarray(to_bytes(colors)).save(tmp_path / name, **options)
    assert icc.profile_space(data) is None and embedded_space(tmp_path / "b.png") is None
    assert_array_equal(read_photo(tmp_path / "a.png"), read_photo(tmp_path / "b.png"))


# --------------------------------------------------------------------------------------------------------------- photos
@pytest.mark.opens(
    "photo",
    "phones, cameras, editors",
    "any kind with an ICC profile",
    "Display P3, Adobe RGB, ProPhoto RGB, tables, gray, CMYK",
)
@pytest.mark.parametrize("name", ["a.png", "a.jpg", "a.webp", "a.tif", "a.heic", "a.avif"])
def test_photos_of_every_kind_are_read_by_their_profile(name, tmp_path):
    plain = np.full((32, 32, 3), (200, 60, 40), np.uint8)
    Image.fromarray(plain).save(tmp_path / name, icc_profile=DISPLAY_P3, quality=100)
    expected = lcms(plain, DISPLAY_P3)[16, 16]
    assert_allclose(read_photo(tmp_path / name)[16, 16] * 255, expected, atol=3)
    assert_allclose(open_photo(tmp_path / name).colors()[16, 16] * 255, expected, atol=3)


def test_sixteen_bits_are_read_by_their_profile(tmp_path, colors):
    values = np.rint(colors * 65535).astype(np.uint16)
    import cv2

    cv2.imwrite(str(tmp_path / "deep.png"), values[..., ::-1])
    Image.fromarray(to_bytes(colors)).save(tmp_path / "a.png", icc_profile=DISPLAY_P3)
    content, donor = (tmp_path / "deep.png").read_bytes(), (tmp_path / "a.png").read_bytes()
    at = donor.index(b"iCCP") - 4
    chunk = donor[at : at + 12 + struct.unpack_from(">I", donor, at)[0]]
    (tmp_path / "deep.png").write_bytes(content[:33] + chunk + content[33:])
    assert_allclose(read_photo(tmp_path / "deep.png"), icc.profile_space(DISPLAY_P3).to_srgb(colors), atol=2e-4)


def test_exif_may_declare_adobe_rgb(tmp_path, colors):
    pointers = struct.pack(">HHHIII", 1, 0x8769, 4, 1, 26, 0) + struct.pack(">HHHIII", 1, 0xA005, 4, 1, 44, 0)
    exif = b"Exif\0\0MM\0*" + struct.pack(">I", 8) + pointers + struct.pack(">HHHI4sI", 1, 1, 2, 4, b"R03", 0)
    Image.fromarray(to_bytes(colors)).save(tmp_path / "a.jpg", exif=exif)
    assert embedded_space(tmp_path / "a.jpg").name == "Adobe RGB (1998)"
    red = icc.adobe_rgb().to_srgb(np.array([0.5, 0.2, 0.2]))
    assert red[0] > 0.56 and red[1] < 0.21


@pytest.mark.parametrize("size", [64, 16])
def test_training_images_are_srgb(size, tmp_path):
    plain = np.full((64, 64, 3), (200, 60, 40), np.uint8)
    Image.fromarray(plain).save(tmp_path / "a.png", icc_profile=DISPLAY_P3)
    view = View("a", "a", Camera(64, 64, 70.0, 70.0, 32.0, 32.0, np.eye(4)), tmp_path / "a.png", "train")
    (image,) = load_views([view], size)
    assert_allclose(image.color[size // 2, size // 2] * 255, lcms(plain, DISPLAY_P3)[0, 0], atol=1)


@pytest.mark.parametrize("mode", ["L", "CMYK"])
def test_gray_and_cmyk_photos_become_srgb(mode, tmp_path):
    image = (
        Image.fromarray(np.full((8, 8), 128, np.uint8)) if mode == "L" else Image.new("CMYK", (8, 8), (0, 128, 128, 0))
    )
    image.save(tmp_path / "a.tif", icc_profile=GRAY_GAMMA_18)
    found = read_photo(tmp_path / "a.tif")
    assert found.shape == (8, 8, 3)
    expected = (0.5752, 0.5752, 0.5752) if mode == "L" else (1.0, 0.498, 0.498)  # 0.502^1.8 in sRGB; Pillow's formula
    assert_allclose(found[0, 0], expected, atol=0.01)
    assert open_photo(tmp_path / "a.tif").space is None


@pytest.mark.parametrize("target", [(0.188, 0.349, 0.722), (0.71, 0.188, 0.173), (1.0, 0.416, 0.0)])
@pytest.mark.parametrize("name", ["a.png", "a.tif"])
def test_target_color_is_shown_by_a_managed_viewer(name, target, tmp_path):
    Image.fromarray(np.full((4, 4, 3), (180, 90, 70), np.uint8)).save(tmp_path / name, icc_profile=DISPLAY_P3)
    photo = open_photo(tmp_path / name).copy()
    photo.change(slice(None), slice(None), np.array(target) - photo.colors())
    out = tmp_path / f"out{suffix_for(photo)}"
    write_photo(out, photo)
    with Image.open(out) as written:
        assert written.info["icc_profile"] == DISPLAY_P3
        shown = icc.profile_space(DISPLAY_P3).to_srgb(np.asarray(written) / 255)
    assert mean_ciede2000(shown[:1, :1], np.array([[target]])) < 0.3


def test_unedited_pixels_keep_their_bits(tmp_path, colors):
    Image.fromarray(to_bytes(colors)).save(tmp_path / "a.png", icc_profile=DISPLAY_P3)
    photo = open_photo(tmp_path / "a.png").copy()
    change = np.zeros((40, 50, 3))
    change[:20] = 0.1
    photo.change(slice(None), slice(None), change)
    assert_array_equal(photo.pixels[20:], to_bytes(colors)[20:])
    assert (photo.pixels[:20] != to_bytes(colors)[:20]).any()
