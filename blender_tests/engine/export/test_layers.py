"""Layered pictures: what is in the file recomposes the edited picture, and the header alone says how."""

from dataclasses import replace

import numpy as np
import OpenEXR
import pytest

from karf_engine.errors import DataError
from karf_engine.export.layer_names import name_layers, read_layer_names
from karf_engine.export.layers import write_layers
from karf_engine.io.color import linear_to_srgb, srgb_to_linear, to_bytes
from karf_engine.palettes.compositing import delta_composite, stack_palettes
from karf_engine.palettes.palette import Palette
from karf_engine.recolor.frames import Layers

POT = Palette("pot", np.array([[0, 0, 0], [0.8, 0.2, 0.1], [0.1, 1 / 3, 0.7]], np.float32))
MUG = Palette("my mug.2", np.array([[0, 0, 0], [0.9, 0.8, 0.7]], np.float32))


@pytest.fixture
def layers():
    random = np.random.default_rng(3)
    weights = random.random((2, 3, 20, 30)).astype(np.float16) / 6
    weights[1, 2] = 0  # the mug has one color less
    base = random.integers(0, 256, (20, 30, 3), dtype=np.uint8)
    depth = random.random((20, 30)).astype(np.float32)
    return Layers((POT, MUG), base, weights.sum(1), weights, depth)


def planes_of(path):
    """The channels of a file as they are stored, by their names."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: channel.pixels for name, channel in file.channels().items()}


def test_the_file_recomposes_the_edited_picture(layers, tmp_path):
    write_layers(tmp_path / "view.exr", layers)
    planes = planes_of(tmp_path / "view.exr")
    edited = {"pot": POT.colors[[0, 2, 1]], "my mug.2": MUG.colors[:, ::-1]}
    result = linear_to_srgb(np.stack([planes[letter] for letter in "RGB"], -1).astype(np.float32))
    for each in read_layer_names(tmp_path / "view.exr"):
        for name, learned, color in zip(each.weights, each.colors, edited[each.name], strict=True):
            result += planes[f"{name}.V"][..., None].astype(np.float32) * (color - learned)
    learned, wanted = (
        stack_palettes(["pot", "my mug.2"], c) for c in ({p.name: p.colors for p in layers.palettes}, edited)
    )
    engine = delta_composite(layers.base.astype(np.float32) / 255, layers.palette_weights, learned, wanted)
    assert np.abs(np.clip(result, 0, 1) - engine).max() < 0.25 / 255


def test_channels_are_named_and_as_deep_as_they_need(layers, tmp_path):
    write_layers(tmp_path / "view.exr", layers)
    planes = planes_of(tmp_path / "view.exr")
    deep = {name for name, plane in planes.items() if plane.dtype == np.float32}
    assert deep == {"Depth.Z", *(f"CryptoObject00.{letter}" for letter in "RGBA")}
    assert set(planes) - deep == {
        *"RGB", "pot_coverage.V", "pot_color_0.V", "pot_color_1.V", "pot_color_2.V",
        "my_mug_2_coverage.V", "my_mug_2_color_0.V", "my_mug_2_color_1.V",
    }  # fmt: skip
    np.testing.assert_array_equal(planes["Depth.Z"], layers.depth)
    np.testing.assert_array_equal(planes["pot_coverage.V"], layers.coverage[0])


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
def test_the_base_comes_back_to_its_eight_bits(layers, tmp_path, kind):
    values = np.arange(256).reshape(16, 16, 1).repeat(3, -1)
    base = values.astype(kind) * 257 if kind is np.uint16 else values.astype(kind) / (255 if kind is np.float32 else 1)
    weights = np.zeros((1, 3, 16, 16))
    write_layers(tmp_path / "view.exr", Layers((POT,), base.astype(kind), weights[:, 0], weights))
    planes = planes_of(tmp_path / "view.exr")
    np.testing.assert_array_equal(to_bytes(linear_to_srgb(planes["G"].astype(np.float32))), values[..., 0])
    np.testing.assert_allclose(planes["G"], srgb_to_linear(values[..., 0] / 255), rtol=2**-11)
    assert "Depth.Z" not in planes


def test_the_header_says_what_the_numbers_are(layers, tmp_path):
    write_layers(tmp_path / "view.exr", layers)
    header = OpenEXR.File(str(tmp_path / "view.exr"), header_only=True).header()
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION
    assert header["colorInteropID"] == "lin_rec709_scene" and "exact piecewise sRGB" in header["comments"]
    np.testing.assert_allclose(header["chromaticities"], (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329), atol=1e-6)
    assert {name.split("/")[-1] for name in header if name.startswith("cryptomatte/")} == {
        "name", "hash", "conversion", "manifest",
    }  # fmt: skip


def test_the_header_alone_gives_names_and_learned_colors(layers, tmp_path):
    write_layers(tmp_path / "view.exr", layers)
    pot, mug = read_layer_names(tmp_path / "view.exr")
    assert (pot.name, mug.name) == ("pot", "my mug.2")
    np.testing.assert_array_equal(pot.colors, POT.colors)
    np.testing.assert_array_equal(mug.colors, MUG.colors)


def test_the_header_tells_the_exposure_of_a_photo_that_has_another(layers, tmp_path):
    path = tmp_path / "view.exr"
    write_layers(path, layers)
    assert b'"gains"' not in path.read_bytes()
    assert read_layer_names(path)[0].gains == (1.0, 1.0, 1.0)
    write_layers(path, replace(layers, gains=(0.75, 1.0, 1.25)))
    assert [each.gains for each in read_layer_names(path)] == [(0.75, 1.0, 1.25)] * 2
    path.write_bytes(path.read_bytes().replace(b"0.75", b"-0.7"))
    with pytest.raises(DataError, match="gains"):
        read_layer_names(path)


def test_names_are_short_and_never_shared():
    colors = np.zeros((2, 3), np.float32)
    objects = name_layers([Palette(name, colors) for name in ("a b", "a.b", "A_B", "ö" * 100, "ö" * 99)])
    names = [name for each in objects for name in (each.coverage, *each.weights)]
    assert len({name.casefold() for name in names}) == len(names) == 15
    assert max(len(name.encode()) for name in names) < 60


def test_a_damaged_or_foreign_file_is_refused(layers, tmp_path):
    write_layers(tmp_path / "view.exr", layers)
    whole = (tmp_path / "view.exr").read_bytes()
    plain = tmp_path / "plain.exr"
    OpenEXR.File({}, {"Y": np.zeros((4, 4), np.float32)}).write(str(plain))
    broken = tmp_path / "broken.exr"
    for content in (plain.read_bytes(), b"", whole[:300], whole.replace(b"karf-layers/1", b"karf-layers/9")):
        broken.write_bytes(content)
        with pytest.raises(DataError):
            read_layer_names(broken)
