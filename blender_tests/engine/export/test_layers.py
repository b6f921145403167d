"""Layered EXR pictures recompose the edited picture, as their header describes, and hold cryptomattes."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from karf_engine.errors import DataError
from karf_engine.export import cryptomatte
from karf_engine.export.layer_names import name_layers, read_layer_names
from karf_engine.export.layered import write_layered
from karf_engine.export.layers import write_layers
from karf_engine.io.color import linear_to_srgb, srgb_to_linear, to_bytes
from karf_engine.io.image_size import ImageHeader
from karf_engine.palettes.compositing import delta_composite, stack_palettes
from karf_engine.palettes.palette import Edit, Palette
from karf_engine.recolor.frames import Layers
from karf_engine.recolor.full_resolution import PhotoView
from karf_engine.recolor.matting.matte import Matte
from karf_engine.recolor.photos import StoredPhoto

POT = Palette("pot", np.array([[0, 0, 0], [0.8, 0.2, 0.1], [0.1, 1 / 3, 0.7]], np.float32))
MUG = Palette("my mug.2", np.array([[0, 0, 0], [0.9, 0.8, 0.7]], np.float32))
EDIT = Edit({palette.name: palette.colors * [0.8, 1.2, 0.9] for palette in (POT, MUG)})
HEIGHT, WIDTH = 6, 9


@pytest.fixture
def layers():
    random = np.random.default_rng(3)
    weights = random.random((2, 3, 20, 30)).astype(np.float16) / 6
    weights[1, 2] = 0  # the mug has one color less
    base = random.integers(0, 256, (20, 30, 3), dtype=np.uint8)
    depth = random.random((20, 30)).astype(np.float32)
    return Layers((POT, MUG), base, weights.sum(1), weights, depth)


@pytest.fixture
def path(layers, tmp_path):
    write_layers(tmp_path / "view.exr", layers)
    return tmp_path / "view.exr"


def read_channels(path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: channel.pixels for name, channel in file.channels().items()}


def test_layered_file_adds_up_to_the_recolored_picture(layers, tmp_path):
    layers = replace(layers, gains=(0.5, 1.0, 1.25))
    write_layered(tmp_path / "view.exr", layers, EDIT)
    planes = {name: plane.astype(np.float32) for name, plane in read_channels(tmp_path / "view.exr").items()}
    picture, photo = (np.stack([planes[f"{layer}{letter}"] for letter in "RGB"], -1) for layer in ("", "photo."))
    changes = [np.stack([planes[f"{name}_change.{letter}"] for letter in "RGB"], -1) for name in ("pot", "my_mug_2")]
    base = layers.base.astype(np.float32) / 255
    np.testing.assert_allclose(photo, srgb_to_linear(base), atol=5e-4)
    np.testing.assert_allclose(photo + sum(changes), picture, atol=2e-3)
    wanted = base.copy()
    for k, palette in enumerate((POT, MUG)):
        by = (EDIT.colors[palette.name] - palette.colors) * layers.gains
        for number, color in enumerate(by):
            wanted += layers.palette_weights[k, number, ..., None].astype(np.float32) * color
    assert np.abs(linear_to_srgb(picture) - wanted.clip(0, 1)).max() < 0.5 / 255
    np.testing.assert_allclose(planes["pot_mask.V"], layers.coverage[0], atol=1e-3)


def test_file_recomposes_the_edited_picture(layers, path):
    planes = read_channels(path)
    edited = {"pot": POT.colors[[0, 2, 1]], "my mug.2": MUG.colors[:, ::-1]}
    result = linear_to_srgb(np.stack([planes[letter] for letter in "RGB"], -1).astype(np.float32))
    for each in read_layer_names(path):
        for name, learned, color in zip(each.weights, each.colors, edited[each.name], strict=True):
            result += planes[f"{name}.V"][..., None].astype(np.float32) * (color - learned)
    palettes = [stack_palettes(["pot", "my mug.2"], c) for c in ({"pot": POT.colors, "my mug.2": MUG.colors}, edited)]
    engine = delta_composite(layers.base.astype(np.float32) / 255, layers.palette_weights, *palettes)
    assert np.abs(np.clip(result, 0, 1) - engine).max() < 0.25 / 255


def test_channels_have_their_names_and_depths(layers, path):
    planes = read_channels(path)
    deep = {name for name, plane in planes.items() if plane.dtype == np.float32}
    assert deep == {"Depth.Z", *(f"CryptoObject00.{letter}" for letter in "RGBA")}
    assert set(planes) - deep == {
        *"RGB", "pot_coverage.V", "pot_color_0.V", "pot_color_1.V", "pot_color_2.V",
        "my_mug_2_coverage.V", "my_mug_2_color_0.V", "my_mug_2_color_1.V",
    }  # fmt: skip
    np.testing.assert_array_equal(planes["Depth.Z"], layers.depth)
    np.testing.assert_array_equal(planes["pot_coverage.V"], layers.coverage[0])


@pytest.mark.parametrize(("kind", "full"), [(np.uint8, 255), (np.uint16, 65535), (np.float32, 1)])
def test_base_round_trips_to_eight_bits(tmp_path, kind, full):
    values = np.arange(256).reshape(16, 16, 1).repeat(3, -1)
    base, weights = (values * (full / 255)).astype(kind), np.zeros((1, 3, 16, 16))
    write_layers(tmp_path / "view.exr", Layers((POT,), base, weights[:, 0], weights))
    planes = read_channels(tmp_path / "view.exr")
    np.testing.assert_array_equal(to_bytes(linear_to_srgb(planes["G"].astype(np.float32))), values[..., 0])
    np.testing.assert_allclose(planes["G"], srgb_to_linear(values[..., 0] / 255), rtol=2**-11)
    assert "Depth.Z" not in planes


def test_header_describes_color_space_and_mattes(path):
    header = OpenEXR.File(str(path), header_only=True).header()
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION
    assert header["colorInteropID"] == "lin_rec709_scene" and "exact piecewise sRGB" in header["comments"]
    np.testing.assert_allclose(header["chromaticities"], (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329), atol=1e-6)
    matte = {name.split("/")[-1] for name in header if name.startswith("cryptomatte/")}
    assert matte == {"name", "hash", "conversion", "manifest"}


def test_header_gives_names_colors_and_exposure(layers, path):
    pot, mug = read_layer_names(path)
    assert (pot.name, mug.name, pot.gains) == ("pot", "my mug.2", (1.0, 1.0, 1.0))
    assert b'"gains"' not in path.read_bytes()
    np.testing.assert_array_equal(pot.colors, POT.colors)
    np.testing.assert_array_equal(mug.colors, MUG.colors)
    write_layers(path, replace(layers, gains=(0.75, 1.0, 1.25)))
    assert [each.gains for each in read_layer_names(path)] == [(0.75, 1.0, 1.25)] * 2


def test_layer_names_are_short_and_unique():
    colors = np.zeros((2, 3), np.float32)
    objects = name_layers([Palette(name, colors) for name in ("a b", "a.b", "A_B", "ö" * 100, "ö" * 99)])
    names = [name for each in objects for name in (each.coverage, *each.weights)]
    assert len({name.casefold() for name in names}) == len(names) == 15
    assert max(len(name.encode()) for name in names) < 60


def test_damaged_or_foreign_files_are_rejected(layers, path):
    write_layers(path, replace(layers, gains=(0.75, 1.0, 1.25)))
    whole = path.read_bytes()
    OpenEXR.File({}, {"Y": np.zeros((4, 4), np.float32)}).write(str(path))
    damages = (path.read_bytes(), whole[:300], whole.replace(b"karf-layers/1", b"karf-layers/9"))
    for content in (*damages, b"", whole.replace(b"0.75", b"-0.7")):
        path.write_bytes(content)
        with pytest.raises(DataError, match="gains" if b"-0.7" in content else None):
            read_layer_names(path)


def photo_view(kind=np.uint8, channels=3, orientation=1):
    random = np.random.default_rng(4)
    full = np.iinfo(kind).max  # colors stay away from black and white, so that no edit clips them
    pixels = random.integers(full // 4, full // 4 * 3, (HEIGHT, WIDTH, channels), dtype=kind)
    photo = StoredPhoto(Path("photo.png"), ImageHeader(WIDTH, HEIGHT, orientation, "png"), pixels)
    mattes = []
    for rows, columns, shape in (((0, 4), (1, 9), (4, 8)), ((2, 6), (0, 5), (4, 5))):
        coverage, mixed = (random.random(shape) / 2).astype(np.float16), np.arange(0, shape[0] * shape[1], 3)
        colors = random.integers(0, 256, (len(mixed), 3), dtype=np.uint8)
        mattes.append(Matte(rows, columns, coverage, mixed, colors))
    return PhotoView(photo, orientation, [POT.name, MUG.name], mattes, [POT, MUG])


def recompose(layers):
    """Recompose like a compositor, from half floats in linear light."""
    base = layers.base / np.iinfo(layers.base.dtype).max if layers.base.dtype.kind == "u" else layers.base
    result = linear_to_srgb(srgb_to_linear(base).astype(np.float16).astype(np.float32))
    for palette, planes in zip(layers.palettes, layers.palette_weights, strict=True):
        change = EDIT.colors[palette.name] - palette.colors
        result += np.einsum("phw,pc->hwc", planes[: len(change)].astype(np.float32), change)
    return np.clip(result, 0, 1)


@pytest.mark.parametrize(
    ("kind", "channels", "orientation"),
    [*((np.uint8, 3, number) for number in range(1, 9)), (np.uint16, 3, 1), (np.uint8, 4, 1), (np.uint16, 4, 1)],
)
def test_photo_layers_are_upright_and_recompose_the_edit(kind, channels, orientation):
    view = photo_view(kind, channels, orientation)
    layers = view.layers(np.arange(6, dtype=np.float32).reshape(2, 3))
    size = (HEIGHT, WIDTH) if orientation < 5 else (WIDTH, HEIGHT)
    assert layers.base.shape[:2] == layers.depth.shape == size
    assert layers.coverage.shape == (2, *size) and layers.palette_weights.shape[::2] == (2, size[0])
    base = layers.base / (255 if layers.base.dtype == np.uint8 else 1)
    np.testing.assert_allclose(base, view.over_white(view.photo), atol=0.51 / 255)
    np.testing.assert_allclose(recompose(layers), view.over_white(view.recolor(EDIT)), atol=1 / 255)


def test_planes_sum_to_coverage_and_depth_keeps_its_edges():
    layers = photo_view().layers(np.array([[1.0, 5.0]], np.float32))
    np.testing.assert_allclose(layers.palette_weights.sum(1, dtype=np.float32), layers.coverage, atol=1e-3)
    assert set(np.unique(layers.depth)) == {1.0, 5.0}
    np.testing.assert_array_equal(layers.depth[0], [1, 1, 1, 1, 5, 5, 5, 5, 5])


def test_hash_is_murmurhash3():
    fox = "The quick brown fox jumps over the lazy dog"
    published = {"": 0, "hello": 0x248BFA47, "hello, world": 0x149BBB7F, fox: 0x2E4FF723}
    assert {text: cryptomatte.murmur3(text.encode()) for text in published} == published


def test_every_id_is_a_normal_float():
    """Programs drop NaN and infinity and may flush subnormal numbers to zero."""
    names = [f"object {number}" for number in range(3000)]
    hashes = np.array([cryptomatte.murmur3(name.encode()) for name in names], np.uint32)
    ids = np.array([cryptomatte.object_id(name) for name in names], np.uint32)
    exponents = ids >> 23 & 255
    assert ((exponents > 0) & (exponents < 255)).all()
    changed = ids != hashes
    assert 0 < changed.sum() < 60 and set((ids ^ hashes)[changed].tolist()) == {1 << 23}


def test_pairs_are_ranked_by_coverage_and_named_in_the_manifest():
    coverage = np.zeros((3, 300, 2), np.float16)  # several bands of rows
    coverage[:, 299, 1] = 0.25, 0.125, 0.625
    planes = cryptomatte.channels(["a", "b", "ä"], coverage)
    assert list(planes) == [f"CryptoObject0{layer}.{letter}" for layer in (0, 1) for letter in "RGBA"]
    pairs = [planes[name][299, 1] for name in planes]
    assert pairs[1::2] == [0.625, 0.25, 0.125, 0]
    ids = np.array(pairs[0::2], np.float32).view(np.uint32).tolist()
    assert ids == [*map(cryptomatte.object_id, ("ä", "a", "b")), 0]
    assert not any(plane[:299].any() for plane in planes.values())
    names = ["Töpfe no. 1", "mug"]
    header = cryptomatte.header(names)
    (manifest,) = (json.loads(value) for name, value in header.items() if name.endswith("/manifest"))
    assert {name: int(id_, 16) for name, id_ in manifest.items()} == {n: cryptomatte.object_id(n) for n in names}
    assert {name.split("/")[1] for name in header} == {f"{cryptomatte.murmur3(b'CryptoObject'):08x}"[:7]}
