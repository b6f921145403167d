"""Axes and color spaces come from the file: they are followed, or the file is refused."""

import gzip
import struct

import numpy as np
import pytest

from blender_tests.engine.splats.clouds import GROUPS
from blender_tests.engine.splats.formats.files import assert_rejected, unit_cloud, write_sample
from karf_engine.splats.formats import packed
from karf_engine.splats.formats.registry import arrays_of, write_splats
from karf_engine.splats.formats.splat_file import SplatFile
from karf_engine.splats.similarity import _harmonics

# of nianticlabs/spz, splat-types.h: numbers and names; a name is the sides of x, y and z
SYSTEMS = dict(enumerate("LDB RDB LUB RUB LDF RDF LUF RUF LBD RBD LBU RBU LFD RFD LFU RFU".split(), 1)) | {0: "RUB"}
IN_PLY = {"R": (1, 0, 0), "L": (-1, 0, 0), "D": (0, 1, 0), "U": (0, -1, 0), "F": (0, 0, 1), "B": (0, 0, -1)}
OTHER_RECORD = struct.pack("<IIfff", 0xADBE0002, 12, 0, 1, 2)  # an orbit's limits


def axes_record(number):
    return struct.pack("<III", 0xADBE0003, 4, number)


def spz(path, version, records, table=None):
    """Write an SPZ file of these numbers with extension records; return the numbers as gsply reads them."""
    gsply, _ = pytest.importorskip("gsply"), pytest.importorskip("zstandard")
    gsply.write_spz(path, packed.to_package(unit_cloud(20) if table is None else table), version=version)
    data = path.read_bytes()
    data = bytearray(data if version == 4 else gzip.decompress(data))
    data[14] |= 2
    if version == 4:
        struct.pack_into("<I", data, 16, 32 + len(records))
        path.write_bytes(data[:32] + records + data[32:])
    else:
        path.write_bytes(gzip.compress(data + records))
    return packed.from_package(gsply.read_spz(path))


def covariances(table):
    w, x, y, z = np.moveaxis(table[:, GROUPS["rotation"]].astype(np.float64), 1, 0)
    rotations = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                          [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                          [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])  # fmt: skip
    axes = np.moveaxis(rotations, 2, 0) * np.exp(table[:, None, GROUPS["scales"]].astype(np.float64))
    return axes @ axes.swapaxes(1, 2)


def colors(table, directions):
    harmonics = table[:, 11:].reshape(len(table), -1, 3)
    return np.einsum("dk,nkc->ndc", _harmonics(directions, harmonics.shape[1]), harmonics)


@pytest.mark.parametrize("version", [3, 4])
@pytest.mark.parametrize("number", SYSTEMS)
def test_spz_axes_follow_the_declared_coordinate_system(number, version, tmp_path):
    numbers = spz(tmp_path / "cloud.spz", version, OTHER_RECORD + axes_record(number))
    found = arrays_of(tmp_path / "cloud.spz")["table"]
    turn = np.array([IN_PLY[side] for side in SYSTEMS[number]]).T
    np.testing.assert_allclose(found[:, :3], numbers[:, :3] @ turn.T, atol=1e-6)
    np.testing.assert_allclose(covariances(found), turn @ covariances(numbers) @ turn.T, atol=1e-6)
    directions = np.random.default_rng(1).normal(size=(9, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    np.testing.assert_allclose(colors(found, directions @ turn.T), colors(numbers, directions), atol=1e-5)


def test_spz_without_a_declaration_is_right_up_back(tmp_path):
    numbers = spz(tmp_path / "cloud.spz", 4, OTHER_RECORD)
    np.testing.assert_allclose(arrays_of(tmp_path / "cloud.spz")["table"][:, :3], numbers[:, :3] * (1, -1, -1))


@pytest.mark.parametrize(
    ("record", "words"), [(axes_record(17), "declares the axes 17"), (axes_record(4)[:10], "unpack_from")]
)
def test_unknown_axes_of_spz_are_rejected(record, words, tmp_path):
    spz(tmp_path / "cloud.spz", 3, record)
    assert_rejected(tmp_path / "cloud.spz", words)


def test_spz_4_is_written_with_its_axes(tmp_path):
    pytest.importorskip("zstandard")
    table, path = unit_cloud(20), tmp_path / "cloud.spz"
    table[:, 14:] = np.clip(table[:, 14:], -0.99, 0.99)
    write_splats(path, SplatFile(table, True), spz_version=4)
    data = path.read_bytes()
    assert struct.unpack_from("<4sIIBBBBI", data) == (b"NGSP", 4, 20, 3, data[13], 3, 6, 44)
    assert data[32:44] == axes_record(4)
    found = arrays_of(path)
    assert found["is_antialiased"].tolist() == [True]
    np.testing.assert_allclose(found["table"][:, :3], table[:, :3], atol=1e-6)
    np.testing.assert_allclose(found["table"][:, 11:], table[:, 11:], atol=1 / 76)


# ----------------------------------------------------------------------------------------------------------- colors of USD
def in_space(path, space, place):
    """Declare a color space on the prim of Gaussians, on one above it, on their colors, or without applying the schema."""
    from pxr import Sdf, Usd

    stage = Usd.Stage.Open(str(path))
    prim = stage.GetPrimAtPath("/Gaussians")
    if place == "above":
        layer = stage.GetRootLayer()
        stage.DefinePrim("/World")
        Sdf.CopySpec(layer, "/Gaussians", layer, "/World/Gaussians")
        stage.RemovePrim("/Gaussians")
        prim = stage.GetPrimAtPath("/World/Gaussians")
    if place == "colors":
        prim.GetAttribute("radiance:sphericalHarmonicsCoefficients").SetColorSpace(space)
    else:
        owner = prim.GetParent() if place == "above" else prim
        if place != "no schema":
            owner.ApplyAPI("ColorSpaceAPI")
        owner.CreateAttribute("colorSpace:name", Sdf.ValueTypeNames.Token).Set(space)
    stage.GetRootLayer().Save()


@pytest.mark.parametrize("place", ["prim", "above", "colors", "no schema"])
@pytest.mark.parametrize("space", ["lin_rec709_scene", "lin_ap1_scene", "g22_rec709_scene", "srgb_p3d65_scene"])
def test_usd_in_other_colors_than_srgb_is_rejected(space, place, tmp_path):
    path = write_sample(tmp_path, ".usda")
    in_space(path, space, place)
    assert_rejected(path, f"color space '{space}'; sRGB is read")


@pytest.mark.parametrize("space", ["srgb_rec709_scene", "srgb_rec709_display", "raw"])
def test_usd_that_declares_srgb_is_read(space, tmp_path):
    path = write_sample(tmp_path, ".usda")
    before = arrays_of(path)["table"]
    in_space(path, space, "prim")
    assert np.array_equal(arrays_of(path)["table"], before)


def test_color_space_of_the_colors_overrides_the_prims(tmp_path):
    path = write_sample(tmp_path, ".usda")
    in_space(path, "lin_rec709_scene", "prim")
    in_space(path, "srgb_rec709_scene", "colors")
    assert len(arrays_of(path)["table"]) == 20
