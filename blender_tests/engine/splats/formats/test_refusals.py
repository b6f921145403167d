"""Files that are damaged, hostile or of another kind give one sentence that names the file, the fault and a remedy."""

import gzip
import json
import struct
import sys
import tracemalloc
import zipfile

import numpy as np
import pytest

from blender_tests.engine.splats.clouds import GROUPS
from blender_tests.engine.splats.formats.files import packaged, refused, unit_cloud, write_sog, written
from karf_engine.errors import BadRequest, MissingDependency
from karf_engine.io import limited
from karf_engine.splats.formats.registry import arrays_of, read_splats, write_splats
from karf_engine.splats.formats.splat_file import SplatFile

TABLE = unit_cloud(20, 1)  # as `written` takes it


# ------------------------------------------------------------------------------------------------------------------ rows
@pytest.mark.parametrize("end", [".ply", ".glb", ".usda"])
@pytest.mark.parametrize(
    ("group", "value", "words"),
    [
        ("center", np.nan, "a center that is not finite"),
        ("center", np.inf, "a center that is not finite"),
        ("scales", np.inf, "a scale that is not finite"),
        ("harmonics", -np.inf, "a color that is not finite"),
        ("rotation", 0, "a rotation that is no quaternion"),
        ("opacity", np.nan, "an opacity that is not a number"),
    ],
)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_row_that_is_no_gaussian_is_named(end, group, value, words, tmp_path):
    table = TABLE.copy()
    table[13, GROUPS[group]] = value
    refused(written(tmp_path, end, table), f"row 13 of 20, counted from 0, has {words}")


def test_flat_and_opaque_gaussians_are_read(tmp_path):
    table = TABLE.copy()
    table[0, 5], table[1, 10], table[2, 10] = -np.inf, np.inf, -np.inf
    found = read_splats(written(tmp_path, ".ply", table)).table
    assert (found[0, 5], found[1, 10], found[2, 10]) == (-87, 16, -87)


# ------------------------------------------------------------------------------------------------------------------ PLY
HEADER = "ply\nformat binary_little_endian 1.0\nelement vertex {}\n{}end_header\n"
FLOATS = "".join(f"property float {name}\n" for name in "x y z".split())


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("solid cube", "it has no line end_header"),
        (HEADER.format(-1, FLOATS), "an element has -1 rows"),
        (HEADER.format(10**9, FLOATS), "it is cut off: 1000000000 rows"),
        (HEADER.format(10**18, FLOATS), "it is cut off"),
        (HEADER.format(0, FLOATS), "its vertices have no scale_0"),
        (HEADER.format(1, "property list uchar int x\n"), "no element vertex without lists"),
        (HEADER.format(1, "property half x\n"), "cannot be understood .'half'."),
        (HEADER.format(1, "property float f_rest_0\n"), "cut off"),
    ],
)
def test_broken_ply(text, words, tmp_path):
    (tmp_path / "cloud.ply").write_text(text)
    refused(tmp_path / "cloud.ply", words)


def test_a_cloud_without_gaussians(tmp_path):
    names = "".join(f"property float {name}\n" for name in "x y z nx ny nz".split())
    (tmp_path / "cloud.ply").write_bytes(HEADER.format(1, names).encode() + bytes(24))
    refused(tmp_path / "cloud.ply", "its vertices have no scale_0 .* f_dc_2")


def test_compressed_ply_with_other_counts(tmp_path):
    path = written(tmp_path, ".compressed.ply")
    data = path.read_bytes()
    for old, new, words in (
        (b"element chunk 1\n", b"element chunk 2\n", "it is cut off"),
        (b"element vertex 20\n", b"element vertex 1000000000\n", "it is cut off"),
        (b"element sh 20\n", b"element sh 2\n", "its numbers of chunks and harmonics"),
        (b"property float min_x\n", b"", "its elements are not those"),
        (b"uchar f_rest_8\n", b"uchar f_rest_9\n", "its elements are not those"),
    ):
        assert old in data
        path.write_bytes(data.replace(old, new))
        refused(path, words)
    path.write_bytes(data[:-1])
    refused(path, "it is cut off")


def test_a_long_header_does_not_hide_that_a_ply_is_compressed(tmp_path):
    path = written(tmp_path, ".compressed.ply")
    start, rest = path.read_bytes().split(b"element", 1)
    path.write_bytes(start + b"comment " + b"x" * 50_000 + b"\nelement" + rest)
    assert len(read_splats(path)) == len(TABLE)


# ------------------------------------------------------------------------------------------------------------------ packed
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere memory has no limit")
@pytest.mark.parametrize("end", [".spz", ".sog"])
def test_a_bomb_takes_no_more_memory_than_its_limit(end, tmp_path, monkeypatch):
    packaged(end)
    monkeypatch.setattr(limited, "LEAST_BYTES", 1 << 30)
    path, block = tmp_path / f"cloud{end}", bytes(1 << 26)
    if end == ".spz":
        with gzip.open(path, "wb", 1) as file:
            file.write(struct.pack("<4sIIBBBB", b"NGSP", 3, 1, 0, 12, 0, 0))
            for _ in range(16):
                file.write(block)
    else:
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("meta.json", "w") as file:
            for _ in range(16):
                file.write(block)
    refused(path, "bytes of memory|too much memory|not gunzip", read_splats)


@pytest.mark.parametrize(
    ("head", "words"),
    [
        ((b"NGSP", 3, 10**9, 0, 12, 0, 0), "payload too small"),
        ((b"NGSP", 1, 1, 0, 12, 0, 0), "version 1"),
        ((b"NGSP", 3, 1, 9, 12, 0, 0), "degree 9"),
        ((b"ABCD", 3, 1, 0, 12, 0, 0), "magic b'ABCD'"),
        ((b"NGSP", 3, 2, 0, 12, 0, 0), "payload too small"),
        ((b"NGSP", 3, 1, 0, 99, 0, 0), "fractional_bits 99"),
    ],
)
def test_broken_spz(head, words, tmp_path):
    pytest.importorskip("gsply")
    (tmp_path / "cloud.spz").write_bytes(gzip.compress(struct.pack("<4sIIBBBB", *head) + bytes(20)))
    refused(tmp_path / "cloud.spz", words)


def test_spz_4_with_false_lengths(tmp_path):
    gsply, _ = pytest.importorskip("gsply"), pytest.importorskip("zstandard")
    from karf_engine.splats.formats.packed import to_package

    path = tmp_path / "cloud.spz"
    gsply.write_spz(path, to_package(TABLE), version=4)
    data = path.read_bytes()
    np.testing.assert_allclose(read_splats(path).table[:, 0], TABLE[:, 0], atol=1e-3)
    path.write_bytes(data[:40] + struct.pack("<Q", 1 << 40) + data[48:])
    refused(path, "size 1099511627776 != expected")
    path.write_bytes(data[:-5])
    refused(path, "overruns file")


def change_meta(path, change):
    with zipfile.ZipFile(path) as file:
        members = {name: file.read(name) for name in file.namelist()}
    meta = json.loads(members["meta.json"])
    change(meta)
    with zipfile.ZipFile(path, "w") as file:
        for name, data in (members | {"meta.json": json.dumps(meta)}).items():
            file.writestr(name, data)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda meta: meta.update(version=3), "version 3"),
        (lambda meta: meta.update(count=10**9), "too small for count"),
        (lambda meta: meta.update(count=400), "too small for count"),
        (lambda meta: meta.update(count=2.0), r"'2\.0' is no whole number"),
        (lambda meta: meta["scales"].update(codebook=[1.0]), "256 numbers were expected in the codebook of scales"),
        (lambda meta: meta["means"].update(maxs=[1, 2, float("nan")]), "a center that is not finite"),
        (lambda meta: meta["quats"].update(files=["../other.webp"]), r"Missing entry '\.\./other\.webp'"),
        (lambda meta: meta.pop("sh0"), "it lacks 'sh0'"),
    ],
)
def test_broken_sog(change, words, tmp_path):
    packaged(".sog")
    write_sog(tmp_path / "cloud.sog", TABLE)
    change_meta(tmp_path / "cloud.sog", change)
    refused(tmp_path / "cloud.sog", words)


def test_a_zip_that_is_cut_off(tmp_path):
    packaged(".sog")
    write_sog(tmp_path / "cloud.sog", TABLE)
    (tmp_path / "cloud.sog").write_bytes((tmp_path / "cloud.sog").read_bytes()[:-30])
    refused(tmp_path / "cloud.sog", "not a zip file")


# ------------------------------------------------------------------------------------------------------------------ glTF
def accessor(content, name):
    return content["accessors"][content["meshes"][0]["primitives"][0]["attributes"][name]]


def extension(content):
    return content["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda content: content["buffers"][0].update(uri="../cloud.bin"), r"wants '\.\./cloud\.bin'"),
        (lambda content: content["buffers"][0].update(uri="/etc/passwd"), "wants '/etc/passwd'"),
        (lambda content: content["buffers"][0].update(uri="https://example.com/a.bin"), "wants 'https:"),
        (lambda content: content["buffers"][0].pop("uri"), "a buffer without bytes"),
        (lambda content: content["bufferViews"][0].update(byteOffset=10**9), "outside its buffer"),
        (lambda content: accessor(content, "POSITION").update(count=10**9), "outside its buffer"),
        (lambda content: accessor(content, "POSITION").update(count=-1), "'-1' is no whole number"),
        (lambda content: accessor(content, "POSITION").update(type="VEC2"), "other widths"),
        (lambda content: accessor(content, "POSITION").update(sparse={}), "without a whole buffer view"),
        (lambda content: content.pop("nodes"), "it lacks 'nodes'"),
        (lambda content: content["nodes"][0].update(children=[0]), "places more than 10,000 nodes"),
        (lambda content: content["nodes"][0].update(scale=[1, 2, 3]), "shears or scales unequally"),
        (lambda content: extension(content).update(colorSpace="lin_rec709_display"), "other colors than srgb"),
        (lambda content: extension(content).update(kernel="box"), "another kernel than ellipse"),
        (lambda content: content["meshes"][0]["primitives"][0].pop("extensions"), "no points with KHR_gaussian"),
    ],
)
def test_broken_gltf(change, words, tmp_path):
    path = written(tmp_path, ".gltf")
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    refused(path, words)


@pytest.mark.parametrize(
    "change",
    [
        lambda content: content.update(nodes=[{"children": [0] * 20_000}]),
        lambda content: content.update(scenes=[{"nodes": [0] * 20_000}]),
        lambda content: content.update(nodes=[*({"children": [n + 1] * 2} for n in range(20)), {"mesh": 0}]),
    ],
    ids=["children", "roots", "doubled"],
)
def test_more_nodes_than_any_scene_has_are_refused_before_they_are_gathered(change, tmp_path):
    path = written(tmp_path, ".gltf", unit_cloud(1, 0))
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    tracemalloc.start()
    refused(path, "places more than 10,000 nodes")
    assert tracemalloc.get_traced_memory()[1] < 100e6
    tracemalloc.stop()


def test_many_primitives_take_time_as_their_number_and_no_more(tmp_path):
    path = written(tmp_path, ".gltf", unit_cloud(1, 0))
    content = json.loads(path.read_text())
    content["meshes"][0]["primitives"] *= 9_000
    path.write_text(json.dumps(content))
    assert len(read_splats(path)) == 9_000


def test_names_beside_a_gltf_may_be_escaped(tmp_path):
    path = written(tmp_path, ".gltf")
    next(tmp_path.glob("*.bin")).rename(tmp_path / "my garden #1%41.bin")
    content = json.loads(path.read_text())
    content["buffers"][0]["uri"] = "my%20garden%20%231%2541.bin"
    path.write_text(json.dumps(content))
    assert len(read_splats(path)) == len(TABLE)
    content["buffers"][0]["uri"] = "..%2Fcloud.bin"
    path.write_text(json.dumps(content))
    refused(path, "which is no file beside it")


def test_nodes_move_what_is_in_them(tmp_path):
    path = written(tmp_path, ".gltf")
    content = json.loads(path.read_text())
    content["nodes"] = [{"children": [1], "translation": [1, 2, 3], "scale": [2, 2, 2]}, {"mesh": 0}]
    path.write_text(json.dumps(content))
    found = read_splats(path).table
    np.testing.assert_allclose(found[:, :3], (2 * TABLE[:, :3] + (1, 2, 3)) * (1, -1, -1), atol=1e-6)
    np.testing.assert_allclose(found[:, 3:6], TABLE[:, 3:6] + np.log(2), atol=1e-6)


@pytest.mark.parametrize(("data", "words"), [(b"{", "Expecting property name"), (b"glTF\2\0\0\0", "unpack_from")])
def test_what_is_no_gltf(data, words, tmp_path):
    (tmp_path / "cloud.glb").write_bytes(data)
    refused(tmp_path / "cloud.glb", words)


# ------------------------------------------------------------------------------------------------------------------ others
def test_splat_of_half_a_row(tmp_path):
    (tmp_path / "cloud.splat").write_bytes(bytes(33))
    refused(tmp_path / "cloud.splat", "33 bytes, which is no multiple of 32")


def test_files_that_are_none(tmp_path):
    refused(tmp_path / "cloud.ply", "does not exist")
    (tmp_path / "cloud.splat").write_bytes(b"")
    refused(tmp_path / "cloud.splat", "is empty")
    with pytest.raises(BadRequest, match=r"cloud\.obj has none of the ends"):
        read_splats(tmp_path / "cloud.obj")


@pytest.mark.parametrize(("end", "package"), [(".spz", "gsply"), (".compressed.ply", "gsply"), (".usdc", "pxr")])
def test_a_missing_package_names_the_extra(end, package, tmp_path, monkeypatch):
    path = written(tmp_path, end)
    monkeypatch.setitem(sys.modules, package, None)
    for work in (lambda: arrays_of(path), lambda: write_splats(path, SplatFile(TABLE))):
        with pytest.raises(MissingDependency, match=rf"has no package '{package}'.*karf\[splats\]"):
            work()
