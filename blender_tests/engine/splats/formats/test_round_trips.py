"""Written splats are read back as precisely as each format allows; rewriting a PLY keeps all foreign bytes."""

import tracemalloc

import numpy as np
import pytest

from blender_tests.engine.splats.formats import files
from karf_engine.errors import BadRequest, DataError
from karf_engine.splats.formats import gltf, packed, ply
from karf_engine.splats.formats.registry import read_splats, write_splats
from karf_engine.splats.formats.splat_file import SplatFile

SINGLE = {"scales": 1e-5, "rotation": 1e-6, "opacity": 2e-7}
PRECISION = {
    **dict.fromkeys((".glb", ".gltf", ".usda", ".usdc", ".usd"), SINGLE),
    ".ply": {},
    ".spz": {"center": 1.2e-7, "scales": 1 / 32, "rotation": 0.002, "opacity": 1 / 510, "color": 1 / 76,
             "harmonics": 1 / 256},
    ".compressed.ply": {"center": 2 / 1023, "scales": 2.5 / 1023, "rotation": 0.003, "opacity": 1 / 255, "color": 0.02,
                        "harmonics": 1 / 32},
    ".sog": {"center": 1e-4, "scales": 2.5 / 255, "rotation": 0.01, "opacity": 1 / 500, "color": 2 / 255,
             "harmonics": 2 / 255},
    ".splat": {"scales": 1e-6, "rotation": 0.02, "opacity": 1 / 500, "color": 1 / 144},
}  # fmt: skip
COLUMNS = {"label": np.arange(20, dtype=np.uint8), "weight": np.linspace(0, 1, 20)}


def check(found, wanted, end):
    far = {name: far for name, far in files.distances(found, wanted).items() if far > PRECISION[end].get(name, 0)}
    assert found.dtype == np.float32 and found.flags.c_contiguous and far == {}


@pytest.mark.opens(
    "splat", "3D Gaussian Splatting and its successors", "`.ply`", "degrees 0 to 3; other columns are kept"
)
@pytest.mark.opens("splat", "SuperSplat, PlayCanvas", "`.compressed.ply`", "degrees 0 to 3")
@pytest.mark.opens("splat", "Scaniverse, Niantic", "`.spz` 2 to 4", "axes as declared, else RUB")
@pytest.mark.opens("splat", "glTF with KHR_gaussian_splatting", "`.glb`, `.gltf`", "sRGB alone; not packed")
@pytest.mark.opens("splat", "OpenUSD 26", "`.usda`, `.usdc`, `.usd`", "sRGB alone")
@pytest.mark.parametrize("degree", range(4))
@pytest.mark.parametrize("end", files.ENDS)
def test_written_gaussians_are_read_back(end, degree, tmp_path):
    table = files.unit_cloud(degree=degree)
    table[:, 14:] = np.clip(table[:, 14:], -0.99, 0.99)  # the range of SPZ
    found = read_splats(files.write_sample(tmp_path, end, table)).table
    check(found, table[packed.morton_order(table)] if end == ".compressed.ply" else table, end)


@pytest.mark.opens("splat", "PlayCanvas", "`.sog` 2", "degrees 0 to 3")
@pytest.mark.opens("splat", "antimatter15, WebGL viewers", "`.splat`", "degree 0")
@pytest.mark.opens("splat", "OpenUSD 26, as a package", "`.usdz`", "read alone")
@pytest.mark.parametrize(("end", "degree"), [*((".sog", degree) for degree in range(4)), (".splat", 0), (".usdz", 1)])
def test_files_of_other_writers_are_read(end, degree, tmp_path):
    files.require_package(end)
    table, path = files.unit_cloud(degree=degree), tmp_path / f"cloud{end}"
    if end == ".sog":
        files.write_sog(path, table)
    elif end == ".splat":
        table[:, 11:] = np.clip(table[:, 11:], -1.7, 1.7)  # colors in [0, 1]
        files.write_splat(path, table)
    else:
        from pxr import UsdUtils

        write_splats(tmp_path / "cloud.usdc", SplatFile(table))
        assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "cloud.usdc"), str(path))
    found = read_splats(path)
    if end == ".splat":
        found.table[:, 6:10] /= np.linalg.norm(found.table[:, 6:10], axis=1, keepdims=True)
    check(found.table, table, ".usdc" if end == ".usdz" else end)
    assert not found.is_antialiased
    if end != ".sog":
        with pytest.raises(BadRequest, match=rf"cloud\{end} has none of the ends \.compressed\.ply, \.ply"):
            write_splats(path, SplatFile(table))
    with pytest.raises(BadRequest, match=r"cloud\.obj has none of the ends"):
        read_splats(tmp_path / "cloud.obj")


@pytest.mark.parametrize("end", [".ply", ".spz"])
@pytest.mark.parametrize("is_antialiased", [True, False])
def test_screen_filter_is_kept(end, is_antialiased, tmp_path):
    files.require_package(end)
    write_splats(tmp_path / f"cloud{end}", SplatFile(files.unit_cloud(4), is_antialiased))
    assert read_splats(tmp_path / f"cloud{end}").is_antialiased is is_antialiased


def test_extreme_opacities_are_kept(tmp_path):
    table = files.unit_cloud(3, 0)
    table[:, 10] = [-87, 16, 0]
    for end in (".glb", ".ply", ".usdc"):
        found = read_splats(files.write_sample(tmp_path, end, table)).table
        np.testing.assert_allclose(found[:, 10], table[:, 10], atol=1)


def test_spz_keeps_distant_centers_up_to_its_limit(tmp_path):
    table = files.unit_cloud(3, 0)
    for far in (1e5, 2**22 - 1):
        table[0, 0] = far
        found = read_splats(files.write_sample(tmp_path, ".spz", table)).table
        np.testing.assert_allclose(found[:, :3], table[:, :3], atol=far * 1.2e-7)
    table[0, 0] = 2**22
    with pytest.raises(BadRequest, match=r"cannot hold a center that is 4\.19e\+06 away") as caught:
        write_splats(tmp_path / "far.spz", SplatFile(table))
    assert ".ply" in caught.value.hint and not (tmp_path / "far.spz").exists()


def test_writing_gltf_overwrites_no_other_file(tmp_path):
    (tmp_path / "cloud.bin").write_bytes(b"precious")
    first, second = SplatFile(files.unit_cloud(3, 0, 1)), SplatFile(files.unit_cloud(3, 0, 2))
    path = tmp_path / "cloud #1.gltf"
    write_splats(path, first)
    before = path.read_bytes()
    write_splats(path, second)
    assert np.array_equal(read_splats(path).table[:, :3], second.table[:, :3])
    assert len(list(tmp_path.glob("cloud #1.*.bin"))) == 1
    write_splats(path, first)
    assert path.read_bytes() == before
    assert (tmp_path / "cloud.bin").read_bytes() == b"precious"


def test_interrupted_write_keeps_the_old_gltf(tmp_path, monkeypatch):
    path, first = tmp_path / "cloud.gltf", SplatFile(files.unit_cloud(3, 0, 1))
    write_splats(path, first)
    atomic_write = gltf.atomic_write

    def interrupted(target, write):
        if target.suffix == ".gltf":
            raise KeyboardInterrupt
        atomic_write(target, write)

    monkeypatch.setattr(gltf, "atomic_write", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_splats(path, SplatFile(files.unit_cloud(3, 0, 2)))
    assert np.array_equal(read_splats(path).table[:, :3], first.table[:, :3])


def foreign(path, order="<", line_end="\n", kind="f4"):
    """Write a PLY with shuffled and additional properties, comments, and a second element."""
    table = files.unit_cloud(20, 1)
    names = ply.property_names(table.shape[1])
    shuffled = [*names[5:], "segment", *names[:5]]
    rows = np.zeros(20, [(name, "u1" if name == "segment" else order + kind) for name in shuffled])
    for name, column in zip(names, table.T, strict=True):
        rows[name] = column
    rows["segment"] = np.arange(20)
    words = {"f4": "float", "f8": "double"}
    lines = ["ply", f"format binary_{'little' if order == '<' else 'big'}_endian 1.0", "comment  made  by hand",
             "comment antialiased 1", "element vertex 20",
             *(f"property {'uchar' if name == 'segment' else words[kind]} {name}" for name in shuffled),
             "element camera 1", "property uchar id", "end_header", ""]  # fmt: skip
    path.write_bytes(line_end.join(lines).encode() + rows.tobytes() + b"\x07")
    return table


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
@pytest.mark.parametrize("kind", ["f4", "f8"])
def test_foreign_ply_is_read_and_rewritten_without_losing_a_byte(order, line_end, kind, tmp_path):
    path, out = tmp_path / "cloud.ply", tmp_path / "out.ply"
    table = foreign(path, order, line_end, kind)
    found = ply.read(path)
    assert np.array_equal(found.table, table) and found.is_antialiased is True
    assert [*found.columns] == ["segment"] and np.array_equal(found.columns["segment"], np.arange(20))
    ply.rewrite(ply.open_original(path), out, found.table)
    assert out.read_bytes() == path.read_bytes()
    changed = table.copy()
    changed[3, 11:] += 0.5
    ply.rewrite(ply.open_original(path), out, changed, {"segment": np.full(20, 9), "label": COLUMNS["label"]})
    found = ply.read(out)
    assert np.array_equal(found.table, changed)
    assert [*found.columns] == ["segment", "label"] and set(found.columns["segment"]) == {9}
    assert np.array_equal(found.columns["label"], COLUMNS["label"])
    before, after = path.read_bytes(), out.read_bytes()
    assert after.endswith(b"\x07") and b"comment  made  by hand" in after
    assert len(after) == len(before) + 20 + len(f"property uchar label{line_end}")


def test_text_ply_is_read_but_not_rewritten(tmp_path):
    path, table = tmp_path / "cloud.ply", files.unit_cloud(2, 0)
    files.write_text(path, table)
    assert np.array_equal(ply.read(path).table, table)
    with pytest.raises(DataError, match=r"cloud\.ply is a PLY file of text"):
        ply.rewrite(ply.open_original(path), path, table)


def test_text_ply_takes_little_more_memory_than_its_numbers(tmp_path):
    path, count = tmp_path / "cloud.ply", 40_000
    names = "".join(f"property float {name}\n" for name in ply.property_names(14))
    head = f"ply\nformat ascii 1.0\nelement camera 1\nproperty float id\nelement vertex {count}\n{names}end_header\n7\n"
    path.write_text(head + f"{' '.join(['1.5'] * 14)}\n" * count)
    tracemalloc.start()
    table = ply.read(path).table
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert table.shape == (count, 14) and (table == 1.5).all()
    assert peak < path.stat().st_size + 30 * table.size, "as strings the numbers would take forty bytes more each"


def test_extra_columns_keep_their_types(tmp_path):
    ply.write(tmp_path / "cloud.ply", SplatFile(files.unit_cloud(20, 2), False, COLUMNS))
    found = ply.read(tmp_path / "cloud.ply").columns
    assert {name: column.dtype for name, column in found.items()} == {"label": np.uint8, "weight": np.float64}
    assert all(np.array_equal(found[name], COLUMNS[name]) for name in COLUMNS)


def test_data_that_a_ply_cannot_hold_is_rejected(tmp_path):
    foreign(tmp_path / "cloud.ply")
    with pytest.raises(ValueError, match=r"\(20, 14\) for a file of \(20, 23\)"):
        ply.rewrite(ply.open_original(tmp_path / "cloud.ply"), tmp_path / "out.ply", files.unit_cloud(20, 0))
    with pytest.raises(ValueError, match="PLY has no type i8"):
        ply.write(tmp_path / "cloud.ply", SplatFile(files.unit_cloud(20, 0), columns={"label": np.arange(20)}))
