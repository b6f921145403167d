"""Written files follow their format and are read by other programs."""

import gzip
import json
import struct

import numpy as np
import pytest

pytest.importorskip("gsply")
pxr = pytest.importorskip("pxr")
plyfile = pytest.importorskip("plyfile")

from blender_tests.engine.splats.formats.files import unit_cloud
from karf_engine.splats.formats import packed
from karf_engine.splats.formats.registry import write_splats
from karf_engine.splats.formats.splat_file import SplatFile

TABLE = unit_cloud(50)


@pytest.fixture
def write(tmp_path):
    def write(name, **columns):
        write_splats(tmp_path / name, SplatFile(TABLE, True, columns))
        return tmp_path / name

    return write


def test_plyfile_reads_ply(write):
    found = plyfile.PlyData.read(write("cloud.ply", label=np.arange(50, dtype=np.int16)))
    vertices = found["vertex"]
    assert found.comments == ["SplatRenderMode: mip"] and vertices.count == 50
    names = [each.name for each in vertices.properties]
    rest = [f"f_rest_{number}" for number in range(45)]
    assert names == [*"xyz", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", *rest, "opacity", "scale_0", "scale_1",
                     "scale_2", "rot_0", "rot_1", "rot_2", "rot_3", "label"]  # fmt: skip
    numbers = ["x", "y", "z", *names[-9:-1], *names[6:9], *rest]
    columns = [0, 1, 2, 10, *range(3, 10), 11, 12, 13]
    columns += [14 + channel + 3 * n for channel in range(3) for n in range(15)]
    for name, column in zip(numbers, columns, strict=True):
        assert np.array_equal(vertices[name], TABLE[:, column]), name
    assert np.array_equal(vertices["label"], np.arange(50))


def test_plyfile_reads_compressed_ply(write):
    found = plyfile.PlyData.read(write("cloud.compressed.ply"))
    order = packed.morton_order(TABLE)
    low, high = found["chunk"]["min_x"][0], found["chunk"]["max_x"][0]
    x = low + (high - low) * (found["vertex"]["packed_position"] >> 21) / 2047
    np.testing.assert_allclose(x, TABLE[order, 0], atol=1e-3)
    assert found["sh"].count == 50 and len(found["sh"].properties) == 45


def test_spz_stores_24_bit_centers_right_up_back(write):
    """Decoded by the format's description, not by a library."""
    data = gzip.decompress(write("cloud.spz").read_bytes())
    magic, version, count, degree, bits, flags, _ = struct.unpack_from("<4sIIBBBB", data)
    assert (magic, version, count, degree, flags) == (b"NGSP", 3, 50, 3, 1)
    parts = np.frombuffer(data, np.uint8, 9 * 50, 16).reshape(50, 3, 3).astype(np.int32)
    numbers = parts[..., 0] | parts[..., 1] << 8 | parts[..., 2] << 16
    centers = np.where(numbers >= 1 << 23, numbers - (1 << 24), numbers) / 2**bits
    np.testing.assert_allclose(centers, TABLE[:, :3] * [1, -1, -1], atol=1e-6)


def glb_chunks(path):
    data = path.read_bytes()
    magic, version, length, size, kind = struct.unpack_from("<4sIII4s", data)
    more, second = struct.unpack_from("<I4s", data, 20 + size)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    assert (kind, second) == (b"JSON", b"BIN\0") and size % 4 == more % 4 == 0 and 28 + size + more == len(data)
    return data[20 : 20 + size], data[28 + size :]


@pytest.mark.parametrize("name", ["cloud.glb", "cloud.gltf"])
def test_gltf_follows_the_specification(write, name):
    path = write(name)
    numbers = next(path.parent.glob("cloud.*.bin"), None)
    text, binary = glb_chunks(path) if numbers is None else (path.read_bytes(), numbers.read_bytes())
    content = json.loads(text)
    assert content["asset"]["version"] == "2.0" and content["extensionsUsed"] == ["KHR_gaussian_splatting"]
    assert content["buffers"] == [{"byteLength": len(binary)} | ({} if numbers is None else {"uri": numbers.name})]
    assert content["nodes"] == [{"mesh": 0, "rotation": [1.0, 0.0, 0.0, 0.0]}]  # upright
    primitive = content["meshes"][0]["primitives"][0]
    extension = primitive["extensions"]["KHR_gaussian_splatting"]
    assert (primitive["mode"], extension["kernel"], extension["colorSpace"]) == (0, "ellipse", "srgb_rec709_display")
    values = {}
    for semantic, number in primitive["attributes"].items():
        accessor = content["accessors"][number]
        view = content["bufferViews"][accessor["bufferView"]]
        start = view["byteOffset"]
        assert start % 4 == 0 and view["target"] == 34962 and accessor["count"] == 50
        kind = {5126: "<f4", 5121: "u1"}[accessor["componentType"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        assert view["byteLength"] == 50 * width * np.dtype(kind).itemsize
        found = np.frombuffer(binary, kind, 50 * width, start).reshape(50, width)
        assert (found.min(0).tolist(), found.max(0).tolist()) == (accessor["min"], accessor["max"])
        values[semantic.removeprefix("KHR_gaussian_splatting:")] = found
    degrees = {f"SH_DEGREE_{d}_COEF_{n}" for d in range(4) for n in range(2 * d + 1)}
    assert set(values) == {"POSITION", "COLOR_0", "ROTATION", "SCALE", "OPACITY"} | degrees
    np.testing.assert_allclose(
        values["ROTATION"], np.roll(TABLE[:, 6:10], -1, 1), atol=1e-6
    )  # unit quaternions, x y z w
    np.testing.assert_allclose(values["SCALE"], np.exp(TABLE[:, 3:6]), rtol=1e-6)
    assert values["OPACITY"].min() >= 0 and values["OPACITY"].max() <= 1


@pytest.mark.parametrize("name", ["cloud.usda", "cloud.usdc", "cloud.usd"])
def test_usd_passes_the_validators(write, name):
    from pxr import Usd, UsdGeom, UsdValidation, UsdVol

    stage = Usd.Stage.Open(str(write(name)))
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert [error.GetMessage() for error in UsdValidation.ValidationContext(validators).Validate(stage)] == []
    field = UsdVol.ParticleField3DGaussianSplat(stage.GetDefaultPrim())
    first = field.GetOrientationsAttr().Get()[0]
    np.testing.assert_allclose([first.GetReal(), *first.GetImaginary()], TABLE[0, 6:10], atol=1e-6)
    assert UsdGeom.GetStageUpAxis(stage) == "Y" and field.GetRadianceSphericalHarmonicsDegreeAttr().Get() == 3
    coefficients = np.array(field.GetRadianceSphericalHarmonicsCoefficientsAttr().Get())
    assert np.array_equal(coefficients, TABLE[:, 11:].reshape(-1, 3))
    up = np.array(field.ComputeLocalToWorldTransform(Usd.TimeCode.Default())).T[:3, :3] @ [0, -1, 0]
    np.testing.assert_allclose(up, [0, 1, 0], atol=1e-12)  # up in the scene is up on the stage
