"""Rows that cannot be Gaussians are skipped and counted in every kind of file; a .ply keeps them byte by byte."""

import json
import zipfile

import numpy as np
import pytest

from blender_tests.engine.splats.clouds import GROUPS
from blender_tests.engine.splats.formats import files
from karf_engine.io.ply import encode_ply, read_ply
from karf_engine.splats.formats import packed, ply
from karf_engine.splats.formats.registry import arrays_of, read_splats
from karf_engine.splats.formats.splat_file import SplatFile

TABLE = files.unit_cloud(20, 1)
FAULTS = [
    ("center", np.nan),
    ("center", np.inf),
    ("scales", np.inf),
    ("scales", np.nan),
    ("harmonics", -np.inf),
    ("color", np.nan),
    ("rotation", 0),
    ("rotation", np.nan),
    ("opacity", np.nan),
]


def found_in(path):
    arrays = arrays_of(path)
    return arrays["table"], int(arrays["n_skipped"])


@pytest.mark.parametrize("end", [".ply", ".glb", ".usda"])
@pytest.mark.parametrize(("group", "value"), FAULTS)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_unusable_rows_are_skipped(end, group, value, tmp_path):
    table = TABLE.copy()
    table[[0, 13], GROUPS[group]] = value
    found, n_skipped = found_in(files.write_sample(tmp_path, end, table))
    assert n_skipped == 2
    files_apart = files.distances(found, np.delete(TABLE, [0, 13], 0))
    assert max(files_apart.values()) < 1e-5, files_apart


@pytest.mark.parametrize("end", [".ply", ".glb"])
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_file_without_a_gaussian_is_rejected(end, tmp_path):
    table = TABLE.copy()
    table[:, 0] = np.nan
    files.assert_rejected(
        files.write_sample(tmp_path, end, table), "none of its 20 rows is one; the first has a center that is not"
    )


def test_splat_skips_rows(tmp_path):
    files.write_splat(tmp_path / "cloud.splat", files.unit_cloud(20, 0))
    rows = np.fromfile(tmp_path / "cloud.splat", [("floats", "<f4", 6), ("bytes", "u1", 8)])
    rows["floats"][3, 1], rows["floats"][5, 4] = np.nan, -1
    rows.tofile(tmp_path / "cloud.splat")
    found, n_skipped = found_in(tmp_path / "cloud.splat")
    assert n_skipped == 2 and np.array_equal(found[:, :3], np.delete(rows["floats"][:, :3], [3, 5], 0))


def test_compressed_ply_skips_the_rows_of_a_damaged_chunk(tmp_path):
    path = files.write_sample(tmp_path, ".compressed.ply", files.unit_cloud(600, 1))
    whole, _ = found_in(path)
    tables = {name: rows.copy() for name, rows in read_ply(path.read_bytes()).tables.items()}
    tables["chunk"]["max_y"][1] = np.nan
    path.write_bytes(encode_ply(tables))
    found, n_skipped = found_in(path)
    assert n_skipped == 256 and np.array_equal(found, np.delete(whole, slice(256, 512), 0))


def test_sog_skips_rows_with_a_nan_code(tmp_path):
    files.require_package(".sog")
    path = tmp_path / "cloud.sog"
    files.write_sog(path, TABLE)
    whole, _ = found_in(path)
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    meta = json.loads(members["meta.json"])
    code = int(np.argmin(np.abs(np.array(meta["scales"]["codebook"]) - whole[4, 3])))
    meta["scales"]["codebook"][code] = float("nan")
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in (members | {"meta.json": json.dumps(meta)}).items():
            archive.writestr(name, data)
    found, n_skipped = found_in(path)
    is_kept = ~(whole[:, 3:6] == whole[4, 3]).any(1)
    assert n_skipped == np.sum(~is_kept) > 0 and np.array_equal(found, whole[is_kept])


def test_skipped_rows_are_counted_across_processes(tmp_path):
    table = TABLE.copy()
    table[[2, 7], 0] = np.nan
    path = files.write_sample(tmp_path, ".gltf", table)
    found = read_splats(path)
    assert (len(found), found.n_skipped) == (18, 2)
    assert str(found.remark(path)).startswith(f"{path}: 2 of 20 rows are no Gaussians")
    assert SplatFile(TABLE).remark(path) is None


def test_ply_keeps_skipped_rows_byte_by_byte(tmp_path):
    path, out = tmp_path / "cloud.ply", tmp_path / "out.ply"
    table = TABLE.copy()
    table[[2, 19], 0], table[5, 6:10], table[7, 11] = np.nan, 0, np.inf
    ply.write(path, SplatFile(table, None, {"label": np.arange(20, dtype=np.uint8)}))
    original = ply.open_original(path)
    kept = [n for n in range(20) if n not in (2, 5, 7, 19)]
    assert original.rows.tolist() == kept and original.splats.columns["label"].tolist() == kept
    ply.rewrite(original, out, original.splats.table)
    assert out.read_bytes() == path.read_bytes()
    changed = original.splats.table.copy()
    changed[:, 11] += 0.5
    ply.rewrite(original, out, changed, {"weight": np.ones(16, np.float32)})
    before, after = (read_ply(each.read_bytes()).tables["vertex"] for each in (path, out))
    skipped = [2, 5, 7, 19]
    assert all(after[name][skipped].tobytes() == before[name][skipped].tobytes() for name in before.dtype.names)
    assert after["weight"].tolist() == [float(n in kept) for n in range(20)]
    np.testing.assert_array_equal(after["f_dc_0"][kept], changed[:, 11])


def test_packed_formats_are_written_without_skipped_rows(tmp_path):
    files.require_package(".compressed.ply")
    table = TABLE.copy()
    table[3, 0] = np.nan
    ply.write(tmp_path / "cloud.ply", SplatFile(table))
    packed.write_compressed_ply(tmp_path / "cloud.compressed.ply", ply.read(tmp_path / "cloud.ply"))
    assert len(found_in(tmp_path / "cloud.compressed.ply")[0]) == 19
