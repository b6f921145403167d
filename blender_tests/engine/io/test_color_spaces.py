"""Photos and layers in named color spaces are read as sRGB and written back within one 16-bit step."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

pytest.importorskip("PyOpenColorIO")
import OpenEXR

from blender_tests.engine.reference.no_files import NO_FILES
from blender_tests.engine.reference.still_life import camera_at
from karf_engine.capture import Capture, View, in_space
from karf_engine.capture.capture import capture_from_json, capture_to_json
from karf_engine.capture.training_images import read_photo_of_view
from karf_engine.errors import BadRequest, DataError, KarfError, MissingDependency
from karf_engine.export.layers import write_layers
from karf_engine.io import color_spaces, limited
from karf_engine.io.color import srgb_to_linear
from karf_engine.io.color_spaces import ColorSpace, color_space
from karf_engine.io.images import encode_image
from karf_engine.palettes.palette import Palette
from karf_engine.recolor.frames import Layers
from karf_engine.recolor.photos import open_photo, write_photo

STEP = 1 / 65535
SPACES = ("ACEScg", "ACEScct", "Linear Rec.2020", "sRGB Encoded P3-D65", "Gamma 2.2 Encoded AdobeRGB")
EXPONENT = "<ExponentTransform> {value: [0.5, 0.5, 0.5, 1]}"
CONFIG = f"""ocio_profile_version: 2
roles:
  scene_linear: plain
  aces_interchange: plain
file_rules:
  - !<Rule> {{name: Default, colorspace: plain}}
displays:
  screen:
    - !<View> {{name: Raw, colorspace: plain}}
colorspaces:
  - !<ColorSpace>
    name: plain
  - !<ColorSpace>
    name: studio
    aliases: [the studio]
    from_scene_reference: !{EXPONENT}
"""


@pytest.fixture(autouse=True)
def no_configuration(monkeypatch):
    monkeypatch.delenv(color_spaces.VARIABLE, raising=False)


def grays_and_random_colors():
    """All 16-bit grays, and random colors of which many are saturated."""
    random = np.random.default_rng(0).integers(0, 65536, (60_000, 3))
    random[:20_000] = np.where(random[:20_000] < 32768, 0, random[:20_000])
    random[20_000:30_000] = np.where(random[20_000:30_000] < 32768, 0, 65535)
    grays = np.repeat(np.arange(65536)[:, None], 3, 1)
    return np.concatenate([grays, random]).astype(np.float32) / np.float32(65535)


@pytest.mark.parametrize("name", SPACES)
def test_colors_survive_a_round_trip_to_another_space(name):
    space, colors = color_space(name), grays_and_random_colors()
    assert np.abs(space.to_srgb(space.from_srgb(colors)) - colors).max() < STEP
    seen = space.to_srgb(colors)
    is_inside = ((seen >= 0) & (seen <= 1)).all(-1)
    assert is_inside.sum() > 100 and np.abs(space.from_srgb(seen) - colors)[is_inside].max() < STEP


def test_conversions_match_the_standards():
    colors = grays_and_random_colors()
    assert_allclose(color_space("Linear Rec.709 (sRGB)").from_srgb(colors), srgb_to_linear(colors), atol=1e-6)
    # Bradford's adaptation from D65 to ACES white
    assert_allclose(color_space("ACEScg").from_srgb(np.eye(3)[0]), [0.6131, 0.0702, 0.0206], atol=2e-4)


def photo_in(path, space):
    """The stored pixels and the view of a 16-bit photo of random colors in a space."""
    stored = np.random.default_rng(1).integers(0, 65536, (32, 32, 3), dtype=np.uint16)
    path.write_bytes(encode_image(".png", stored))
    return stored, View("a", "a", camera_at(0.3, 0.5), path, "train", space=space)


def test_photos_are_converted_to_srgb(tmp_path):
    space = color_space("sRGB Encoded P3-D65")
    stored, view = photo_in(tmp_path / "a.png", space)
    expected = np.clip(space.to_srgb(stored / 65535), 0, 1)
    assert_allclose(read_photo_of_view(view), expected, atol=1e-6)
    assert_allclose(open_photo(view.image, space).colors(), expected, atol=1e-6)
    assert np.abs(read_photo_of_view(replace(view, space=None)) - expected).max() > 0.05


def test_exr_colors_are_converted_without_premultiplied_alpha(tmp_path):
    space = color_space("ACEScg")
    colors, alpha = np.random.default_rng(2).uniform(0.1, 0.8, (32, 32, 3)), np.full((32, 32, 1), 0.5)
    light = np.dstack([space.from_srgb(colors) * alpha, alpha]).astype(np.float32)
    OpenEXR.File({}, {"RGBA": light}).write(str(tmp_path / "a.exr"))
    _, view = photo_in(tmp_path / "a.png", space)
    assert_allclose(read_photo_of_view(replace(view, image=tmp_path / "a.exr"))[..., :3], colors, atol=1e-5)
    photo = open_photo(tmp_path / "a.exr", space).copy()
    photo.change(slice(None), slice(None), np.full((32, 32, 3), 0.1, np.float32))
    assert_allclose(photo.colors(), colors + 0.1, atol=1e-5)


@pytest.mark.parametrize("name", SPACES)
def test_recolored_photos_keep_their_space_and_unchanged_pixels(tmp_path, name):
    space = color_space(name)
    stored, view = photo_in(tmp_path / "a.png", space)
    photo = open_photo(view.image, space).copy()
    change = np.zeros((32, 32, 3), np.float32)
    change[:16] = np.clip(photo.colors()[:16] * 0.5, 0.02, None) * [0.5, -0.5, 0.2]
    wanted = space.from_srgb(np.clip(photo.colors() + change, 0, 1))
    seen = space.to_srgb(stored / 65535)
    is_inside = ((seen >= 0) & (seen <= 1)).all(-1)[:16]
    photo.change(slice(None), slice(None), change)
    write_photo(tmp_path / "new.png", photo)
    pixels = open_photo(tmp_path / "new.png", space).pixels
    assert_array_equal(pixels[16:], stored[16:])
    apart = np.abs(pixels - np.rint(np.clip(wanted, 0, 1) * 65535))[:16]
    assert apart[is_inside].max() <= 1
    # colors outside sRGB change by as much as the edit changes their clipped colors
    assert (pixels[:16] != stored[:16]).any(-1).mean() > 0.8


def test_layers_hold_the_base_picture_in_the_named_space(tmp_path):
    base = np.random.default_rng(4).integers(0, 65536, (20, 30, 3), dtype=np.uint16)
    pot = Palette("pot", np.array([[0, 0, 0], [0.8, 0.2, 0.1]], np.float32))
    layers = Layers((pot,), base, np.ones((1, 20, 30), np.float16), np.full((1, 2, 20, 30), 0.5, np.float16))
    space = color_space("ACEScg")
    write_layers(tmp_path / "a.exr", layers, space)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        light = np.stack([file.channels()[letter].pixels for letter in "RGB"], -1)
        header = dict(file.header())
    assert np.abs(space.to_srgb(light) - base / 65535).max() < STEP
    assert header["colorInteropID"] == "lin_ap1_scene" and "ACEScg" in header["comments"]
    assert "chromaticities" not in header


def test_capture_stores_a_color_space_only_where_one_is_set(tmp_path):
    _, view = photo_in(tmp_path / "a.png", None)
    plain = Capture(tmp_path, "llff", (view,))
    before = capture_to_json(plain)
    assert before["schema"] == "karf-capture/1" and "color_space" not in before["views"][0]
    assert in_space(plain, None) is plain
    space = ColorSpace("studio", "/show/config.ocio")
    content = capture_to_json(in_space(plain, space))
    assert content["schema"] == "karf-capture/3"
    assert capture_from_json(content, tmp_path / "capture.json").views[0].space == space


@pytest.fixture
def config(tmp_path):
    (tmp_path / "config.ocio").write_text(CONFIG)
    return tmp_path / "config.ocio"


def test_configuration_is_found_by_path_or_environment(config, monkeypatch):
    space, light = color_space("the studio", str(config)), np.array([0.1, 0.4, 0.9])
    assert space == ColorSpace("the studio", str(config))
    assert_allclose(space.to_srgb(np.sqrt(light)), color_space("ACES2065-1").to_srgb(light), atol=1e-5)
    monkeypatch.setenv(color_spaces.VARIABLE, str(config))
    assert color_space("studio") == ColorSpace("studio", str(config))


@pytest.mark.parametrize(
    ("content", "error", "words"),
    [
        ("colorspaces: 3", DataError, r"config\.ocio cannot be read"),
        ("ocio_profile_version: 99", DataError, r"config\.ocio cannot be read"),
        (
            CONFIG.replace("  aces_interchange: plain\n", ""),
            BadRequest,
            r"'studio' of the color configuration .* no way to sRGB.*interchange roles",
        ),
    ],
)
def test_unusable_configuration_is_rejected(config, content, error, words):
    config.write_text(content)
    with pytest.raises(error, match=words):
        color_space("studio", str(config))


def test_unknown_space_and_missing_package_give_helpful_errors(monkeypatch):
    with pytest.raises(BadRequest, match=r"no color space 'ACES cg'.*built-in.* Nearest: ACEScg"):
        color_space("ACES cg")
    color_spaces._config.cache_clear(), color_spaces._check.cache_clear()
    monkeypatch.setitem(sys.modules, "PyOpenColorIO", None)
    with pytest.raises(MissingDependency, match=r"opencolorio.*karf\[color\]"):
        color_space("ACEScg")


@pytest.mark.parametrize("make", NO_FILES)
def test_configuration_that_is_no_file_is_rejected_without_waiting(make, config, monkeypatch):
    monkeypatch.setattr(limited, "LEAST_SECONDS", 3)
    path = config.with_name("no_file")
    make(path)
    with pytest.raises(DataError, match=r"no_file is a .*, not a file"):
        color_space("studio", str(path))
    config.write_text(CONFIG.replace(EXPONENT, f"<FileTransform> {{src: {path}}}"))
    with pytest.raises(KarfError, match=r"config\.ocio (cannot be read: it|has no way to sRGB: .*no_file)"):
        color_space("studio", str(config))
