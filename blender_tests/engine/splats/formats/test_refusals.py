"""Damaged, hostile and foreign splat files are rejected with the file, the fault and a remedy."""

import gzip
import json
import struct
import sys
import tracemalloc
import zipfile
from functools import reduce
from operator import getitem

import numpy as np
import pytest

from blender_tests.engine.peak import peak_of
from blender_tests.engine.splats.clouds import GROUPS
from blender_tests.engine.splats.formats.files import assert_rejected, require_package, unit_cloud, write_sample
from karf_engine.errors import MissingDependency
from karf_engine.io import limited
from karf_engine.splats.formats.ply import property_names
from karf_engine.splats.formats.registry import arrays_of, read_splats, write_splats
from karf_engine.splats.formats.splat_file import SplatFile

TABLE = unit_cloud(20, 1)  # the default of write_sample
LIMITED = pytest.mark.skipif(sys.platform != "linux", reason="memory is limited on Linux alone")


def replaced(old, new):
    def change(path):
        data = path.read_bytes()
        assert old in data
        path.write_bytes(data.replace(old, new))

    return change


def in_json(change):
    def rewrite(path):
        content = json.loads(path.read_text())
        change(content)
        path.write_text(json.dumps(content))

    return rewrite


def in_meta(change):
    def rewrite(path):
        with zipfile.ZipFile(path) as file:
            members = {name: file.read(name) for name in file.namelist()}
        meta = json.loads(members["meta.json"])
        change(meta)
        with zipfile.ZipFile(path, "w") as file:
            for name, data in (members | {"meta.json": json.dumps(meta)}).items():
                file.writestr(name, data)

    return rewrite


def cut(count):
    return lambda path: path.write_bytes(path.read_bytes()[:-count])


def changed(folder, end, change):
    path = write_sample(folder, end)
    change(path)
    return path


def test_flat_and_opaque_gaussians_are_read(tmp_path):
    table = TABLE.copy()
    table[0, 5], table[1, 10], table[2, 10] = -np.inf, np.inf, -np.inf
    found = read_splats(write_sample(tmp_path, ".ply", table)).table
    assert (found[0, 5], found[1, 10], found[2, 10]) == (-87, 16, -87)


def ply(rows, *properties, encoding="binary_little_endian"):
    lines = [f"element vertex {rows}", *(f"property {each}" for each in properties), "end_header", ""]
    return "\n".join(["ply", f"format {encoding} 1.0", *lines]).encode()


TEXT_PLY = ply(2, *(f"float {name}" for name in property_names(14)), encoding="ascii")


def spz(*head):
    return gzip.compress(struct.pack("<4sIIBBBB", *head) + bytes(20))


XYZ = ("float x", "float y", "float z")
CONTENTS = [
    ("ply", None, "does not exist"),
    ("ply", b"solid cube", "it has no line end_header"),
    ("ply", ply(-1, *XYZ), "an element has -1 rows"),
    ("ply", ply(10**9, *XYZ), "it is cut off: 1000000000 rows"),
    ("ply", ply(10**18, *XYZ), "it is cut off"),
    ("ply", ply(0, *XYZ), "its vertices have no scale_0"),
    ("ply", ply(1, *XYZ, "float nx", "float ny", "float nz") + bytes(24), "have no scale_0 .* f_dc_2"),
    ("ply", ply(1, "list uchar int x"), "no element vertex without lists"),
    ("ply", ply(1, "half x"), "cannot be understood .'half'."),
    ("ply", ply(1, "float f_rest_0"), "cut off"),
    ("ply", TEXT_PLY + b"1 " * 13, "2 rows do not fit into its 13 numbers"),
    ("ply", TEXT_PLY + b"x " * 28, "its rows are not numbers"),
    ("spz", spz(b"NGSP", 3, 10**9, 0, 12, 0, 0), "payload too small"),
    ("spz", spz(b"NGSP", 1, 1, 0, 12, 0, 0), "version 1"),
    ("spz", spz(b"NGSP", 3, 1, 9, 12, 0, 0), "degree 9"),
    ("spz", spz(b"ABCD", 3, 1, 0, 12, 0, 0), "magic b'ABCD'"),
    ("spz", spz(b"NGSP", 3, 1, 0, 99, 0, 0), "fractional_bits 99"),
    ("glb", b"{", "Expecting property name"),
    ("glb", b"glTF\2\0\0\0", "unpack_from"),
    ("splat", bytes(33), "33 bytes, which is no multiple of 32"),
    ("splat", b"", "is empty"),
]


@pytest.mark.parametrize(("end", "data", "words"), CONTENTS)
def test_contents_without_gaussians_are_rejected(end, data, words, tmp_path):
    require_package(f".{end}")
    path = tmp_path / f"cloud.{end}"
    if data is not None:
        path.write_bytes(data)
    assert_rejected(path, words)


def primitives(content):
    return content["meshes"][0]["primitives"]


def inside(*place):
    """Return a change of values of the object at this place."""
    return lambda **values: in_json(lambda content: reduce(getitem, place, content).update(values))


def positions(**values):
    def change(content):
        content["accessors"][primitives(content)[0]["attributes"]["POSITION"]].update(values)

    return in_json(change)


buffer, view, node = inside("buffers", 0), inside("bufferViews", 0), inside("nodes", 0)
extension = inside("meshes", 0, "primitives", 0, "extensions", "KHR_gaussian_splatting")


CLIPS = b'clips = { dictionary default = { asset[] assetPaths = [@./other.usda@]\nstring primPath = "/Gaussians" } }'
PRIM = b'ParticleField3DGaussianSplat "Gaussians"'
PASSWORDS = b"@/etc/passwd@"
VARIANTS = b'def "A" (variantSets = "v")\n{\nvariantSet "v" = {\n"x" {\ndef "B" (payload = @/etc/passwd@) {}\n}\n}\n}\n'
COMPRESSED = [
    (replaced(b"element chunk 1\n", b"element chunk 2\n"), "it is cut off"),
    (replaced(b"element vertex 20\n", b"element vertex 1000000000\n"), "it is cut off"),
    (replaced(b"element sh 20\n", b"element sh 2\n"), "its numbers of chunks and harmonics"),
    (replaced(b"property float min_x\n", b""), "its elements are not those"),
    (replaced(b"uchar f_rest_8\n", b"uchar f_rest_9\n"), "its elements are not those"),
    (cut(1), "it is cut off"),
]
SOG = [
    (in_meta(lambda meta: meta.update(version=3)), "version 3"),
    (in_meta(lambda meta: meta.update(count=10**9)), "too small for count"),
    (in_meta(lambda meta: meta.update(count=2.0)), r"'2\.0' is no whole number"),
    (in_meta(lambda meta: meta["scales"].update(codebook=[1.0])), "256 numbers were expected in the codebook of"),
    (in_meta(lambda meta: meta["means"].update(maxs=[1, 2, float("nan")])), "a center that is not finite"),
    (in_meta(lambda meta: meta["quats"].update(files=["../other.webp"])), r"Missing entry '\.\./other\.webp'"),
    (in_meta(lambda meta: meta.pop("sh0")), "it lacks 'sh0'"),
    (cut(30), "not a zip file"),
]
GLTF = [
    (buffer(uri="../cloud.bin"), r"wants '\.\./cloud\.bin'"),
    (buffer(uri="..%2Fcloud.bin"), "which is no file beside it"),
    (buffer(uri="/etc/passwd"), "wants '/etc/passwd'"),
    (buffer(uri="https://example.com/a.bin"), "wants 'https:"),
    (in_json(lambda content: content["buffers"][0].pop("uri")), "a buffer without bytes"),
    (view(byteOffset=10**9), "outside its buffer"),
    (positions(count=10**9), "outside its buffer"),
    (positions(count=-1), "'-1' is no whole number"),
    (positions(type="VEC2"), "other widths"),
    (positions(sparse={}), "without a whole buffer view"),
    (in_json(lambda content: content.pop("nodes")), "it lacks 'nodes'"),
    (node(scale=[1, 2, 3]), "shears or scales unequally"),
    (extension(colorSpace="lin_rec709_display"), "whose colorSpace is 'lin_rec709_display'"),
    (extension(kernel="box"), "whose kernel is 'box'"),
    (extension(kernel="ellipse", extensions={"KHR_packed": {}}), r"packed Gaussians .KHR_packed."),
    (in_json(lambda content: primitives(content)[0].pop("extensions")), "no points with KHR_gaussian"),
]
USDA = [
    (replaced(b"#usda 1.0", b"nothing"), "usd-core cannot read it"),
    (replaced(b"HarmonicsDegree = 1", b"HarmonicsDegree = 4"), "its harmonics are of degree 4"),
    (replaced(b"def ParticleField3DGaussianSplat", b"def Xform"), "it has no ParticleField3DGaussianSplat"),
    (replaced(b"(\n    defaultPrim", b"(\n    subLayers = [%b]\n    defaultPrim" % PASSWORDS), "refers to other files"),
    (replaced(b"float[] opacities", b"float[] other"), "has no opacities"),
    (replaced(b"rotateX = 180", b"rotateX = nan"), "moved by a matrix"),
    (replaced(b"\ndef ", b'\ndef "More" (references = %b) {}\ndef ' % PASSWORDS), "other files, such as /etc/passwd"),
    (replaced(b"\ndef ", b'\ndef "More" (payload = %b) {}\ndef ' % PASSWORDS), "other files, such as /etc/passwd"),
    (replaced(b"\ndef ", b"\n%bdef " % VARIANTS), "other files, such as /etc/passwd"),
    (replaced(PRIM, b"%b (\n%b\n)" % (PRIM, CLIPS)), "other files, such as the value clips of /Gaussians"),
    (replaced(b"\ndef ", b'\ndef "More" (references = </Nothing>) {}\ndef '), "cannot be composed .*</Nothing>"),
]
CHANGES = {".compressed.ply": COMPRESSED, ".sog": SOG, ".gltf": GLTF, ".usda": USDA}


@pytest.mark.parametrize(("end", "change", "words"), [(end, *row) for end, rows in CHANGES.items() for row in rows])
def test_malformed_change_of_a_valid_file_is_rejected(end, change, words, tmp_path):
    assert_rejected(changed(tmp_path, end, change), words)


def test_spz_4_with_wrong_lengths_is_rejected(tmp_path):
    gsply, _ = pytest.importorskip("gsply"), pytest.importorskip("zstandard")
    from karf_engine.splats.formats.packed import to_package

    path = tmp_path / "cloud.spz"
    gsply.write_spz(path, to_package(TABLE), version=4)
    data = path.read_bytes()
    np.testing.assert_allclose(read_splats(path).table[:, 0], TABLE[:, 0], atol=1e-3)
    path.write_bytes(data[:40] + struct.pack("<Q", 1 << 40) + data[48:])
    assert_rejected(path, "size 1099511627776 != expected")
    path.write_bytes(data[:-5])
    assert_rejected(path, "overruns file")


def rename_with_escapes(path):
    next(path.parent.glob("*.bin")).rename(path.parent / "my garden #1%41.bin")
    buffer(uri="my%20garden%20%231%2541.bin")(path)


@pytest.mark.parametrize(
    ("end", "change", "count"),
    [
        (".compressed.ply", replaced(b"element chunk", b"comment " + b"x" * 50_000 + b"\nelement chunk"), 20),
        (".gltf", rename_with_escapes, 20),
        (".gltf", in_json(lambda content: primitives(content).extend(3_000 * primitives(content))), 60_020),
        (".usda", replaced(b"\ndef ", b'\ndef "More" (references = </Gaussians>) {}\ndef '), 40),
    ],
    ids=["long header", "escaped name", "many primitives", "reference within the file"],
)
def test_unusual_but_valid_file_is_read(end, change, count, tmp_path):
    assert len(read_splats(changed(tmp_path, end, change))) == count


def test_gltf_node_transforms_are_applied(tmp_path):
    nodes = [{"children": [1], "translation": [1, 2, 3], "scale": [2, 2, 2]}, {"mesh": 0}]
    found = read_splats(changed(tmp_path, ".gltf", in_json(lambda content: content.update(nodes=nodes)))).table
    np.testing.assert_allclose(found[:, :3], (2 * TABLE[:, :3] + (1, 2, 3)) * (1, -1, -1), atol=1e-6)
    np.testing.assert_allclose(found[:, 3:6], TABLE[:, 3:6] + np.log(2), atol=1e-6)


def test_usd_with_z_up_is_rotated(tmp_path):
    path = changed(tmp_path, ".usda", replaced(b'upAxis = "Y"', b'upAxis = "Z"'))
    replaced(b"rotateX = 180", b"rotateX = 0")(path)
    found = read_splats(path).table  # x right, y forward, z up, where PLY has x right, y down, z forward
    np.testing.assert_allclose(found[:, :3], TABLE[:, [0, 2, 1]] * (1, -1, 1), atol=1e-6)


@LIMITED
def test_zip_bomb_stays_within_the_memory_limit(tmp_path, monkeypatch):
    require_package(".sog")
    monkeypatch.setattr(limited, "LEAST_BYTES", 1 << 30)
    path = tmp_path / "cloud.sog"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("meta.json", "w") as file:
        for _ in range(16):
            file.write(bytes(1 << 26))
    assert_rejected(path, "bytes of memory|too much memory", read_splats)


@pytest.mark.parametrize(
    "content",
    [
        {"nodes": [{"children": [0] * 20_000}]},
        {"scenes": [{"nodes": [0] * 20_000}]},
        {"nodes": [*({"children": [n + 1] * 2} for n in range(20)), {"mesh": 0}]},
    ],
    ids=["children", "roots", "doubled"],
)
def test_too_many_gltf_nodes_are_rejected_before_allocation(content, tmp_path):
    path = changed(tmp_path, ".gltf", in_json(lambda whole: whole.update(content)))
    tracemalloc.start()
    assert_rejected(path, "places more than 10,000 nodes")
    assert tracemalloc.get_traced_memory()[1] < 100e6
    tracemalloc.stop()


@pytest.mark.parametrize("arc", ["references", "instanceable = true\nreferences"])
def test_exponential_usd_references_are_rejected(arc, tmp_path, monkeypatch):
    monkeypatch.setattr(limited, "LEAST_BYTES", 1 << 30)
    path = write_sample(tmp_path, ".usda")
    prim = 'def Xform "A{1}" {{\ndef "l" ({2} = </A{0}>) {{}}\ndef "r" ({2} = </A{0}>) {{}}\n}}\n'
    doubling = "".join(prim.format(n, n + 1, arc) for n in range(39))
    path.write_text(path.read_text() + 'def Xform "A0" {}\n' + doubling)
    assert_rejected(path, "crashed or needed too much|more than 10,000 prims", read_splats)


def test_usd_array_claiming_a_billion_numbers_is_rejected(tmp_path):
    table = unit_cloud(700, 0)
    table[:, GROUPS["opacity"]] = 16  # usd-core packs equal values
    path = write_sample(tmp_path, ".usdc", table)
    path.write_bytes(path.read_bytes().replace(struct.pack("<Q", 700), struct.pack("<Q", 10**9), 1))
    assert_rejected(path, "usd-core cannot read it", read_splats)


@LIMITED
@pytest.mark.parametrize(("opening", "closing", "count"), [("[", "]", 400_000), ("(", ")", 10**6)])
def test_deeply_nested_usda_stays_within_the_memory_limit(opening, closing, count, tmp_path):
    require_package(".usda")
    path = tmp_path / "cloud.usda"
    path.write_text('#usda 1.0\ndef "a" { float3[] p = [' + count * opening + count * closing + "]}")
    code = "from karf_engine.splats.formats.registry import read_splats; read_splats(Path(sys.argv[1]))"
    peak = peak_of(code, path, fails_with="DataError")
    assert peak < limited.LEAST_BYTES + limited.BYTES_PER_BYTE * path.stat().st_size


@pytest.mark.parametrize(("end", "package"), [(".spz", "gsply"), (".compressed.ply", "gsply"), (".usdc", "pxr")])
def test_missing_package_error_names_the_extra(end, package, tmp_path, monkeypatch):
    path = write_sample(tmp_path, end)
    monkeypatch.setitem(sys.modules, package, None)
    for work in (lambda: arrays_of(path), lambda: write_splats(path, SplatFile(TABLE))):
        with pytest.raises(MissingDependency, match=rf"has no package '{package}'.*karf\[splats\]"):
            work()
