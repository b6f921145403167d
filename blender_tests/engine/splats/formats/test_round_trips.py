"""What is written is read again, to the precision that each kind of file has; see the kinds' docstrings."""

import numpy as np
import pytest

pytest.importorskip("gsply")
pytest.importorskip("pxr")

from blender_tests.engine.splats.formats.files import ENDS, distances, unit_cloud, write_sog, write_splat
from karf_engine.errors import BadRequest
from karf_engine.splats.formats import gltf, packed
from karf_engine.splats.formats.registry import read_splats, write_splats
from karf_engine.splats.formats.splat_file import SplatFile

EXACT = {"center": 0, "scales": 0, "rotation": 0, "opacity": 0, "color": 0, "harmonics": 0}
SINGLE = EXACT | {"scales": 1e-5, "rotation": 1e-6, "opacity": 2e-7}
PRECISION = {
    ".ply": EXACT,
    ".glb": SINGLE,
    ".gltf": SINGLE,
    ".usda": SINGLE,
    ".usdc": SINGLE,
    ".usd": SINGLE,
    ".spz": {"center": 1.2e-7, "scales": 1 / 32, "rotation": 0.002, "opacity": 1 / 510, "color": 1 / 76,
             "harmonics": 1 / 256},
    ".compressed.ply": {"center": 2 / 1023, "scales": 2.5 / 1023, "rotation": 0.003, "opacity": 1 / 255, "color": 0.02,
                        "harmonics": 1 / 32},
    ".sog": {"center": 1e-4, "scales": 2.5 / 255, "rotation": 0.01, "opacity": 1 / 500, "color": 2 / 255,
             "harmonics": 2 / 255},
    ".splat": {"center": 0, "scales": 1e-6, "rotation": 0.02, "opacity": 1 / 500, "color": 1 / 144, "harmonics": 0},
}  # fmt: skip


def check(found, wanted, end):
    far = {name: far for name, far in distances(found, wanted).items() if far > PRECISION[end][name]}
    assert found.dtype == np.float32 and found.flags.c_contiguous and far == {}


@pytest.mark.parametrize("degree", range(4))
@pytest.mark.parametrize("end", ENDS)
def test_what_is_written_is_read_again(end, degree, tmp_path):
    table = unit_cloud(degree=degree)
    table[:, 14:] = np.clip(table[:, 14:], -0.99, 0.99)  # as far as SPZ goes
    write_splats(tmp_path / f"cloud{end}", SplatFile(table))
    order = packed.morton_order(table) if end == ".compressed.ply" else slice(None)
    check(read_splats(tmp_path / f"cloud{end}").table, table[order], end)


@pytest.mark.parametrize("degree", range(4))
def test_sog_is_read(degree, tmp_path):
    table = unit_cloud(degree=degree)
    write_sog(tmp_path / "cloud.sog", table)
    found = read_splats(tmp_path / "cloud.sog")
    check(found.table, table, ".sog")
    assert found.is_antialiased is False


def test_splat_is_read(tmp_path):
    table = unit_cloud(degree=0)
    table[:, 11:] = np.clip(table[:, 11:], -1.7, 1.7)  # colors in [0, 1]
    write_splat(tmp_path / "cloud.splat", table)
    found = read_splats(tmp_path / "cloud.splat").table
    found[:, 6:10] /= np.linalg.norm(found[:, 6:10], axis=1, keepdims=True)
    check(found, table, ".splat")


def test_usdz_is_read(tmp_path):
    from pxr import UsdUtils

    table = unit_cloud(20, 1)
    write_splats(tmp_path / "cloud.usdc", SplatFile(table))
    assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "cloud.usdc"), str(tmp_path / "cloud.usdz"))
    check(read_splats(tmp_path / "cloud.usdz").table, table, ".usdc")


@pytest.mark.parametrize("end", [".ply", ".spz"])
@pytest.mark.parametrize("is_antialiased", [True, False])
def test_the_screen_filter_is_kept(end, is_antialiased, tmp_path):
    write_splats(tmp_path / f"cloud{end}", SplatFile(unit_cloud(4), is_antialiased))
    assert read_splats(tmp_path / f"cloud{end}").is_antialiased is is_antialiased


def test_opacities_of_nothing_and_all_stay_apart_from_others(tmp_path):
    table = unit_cloud(3, 0)
    table[:, 10] = [-87, 16, 0]
    for end in (".glb", ".usdc", ".ply"):
        write_splats(tmp_path / f"cloud{end}", SplatFile(table))
        np.testing.assert_allclose(read_splats(tmp_path / f"cloud{end}").table[:, 10], table[:, 10], atol=1)


def test_far_centers_of_spz_are_not_cut_off(tmp_path):
    table = unit_cloud(3, 0)
    table[0, 0] = 1e5
    write_splats(tmp_path / "cloud.spz", SplatFile(table))
    np.testing.assert_allclose(read_splats(tmp_path / "cloud.spz").table[:, :3], table[:, :3], atol=1e5 * 1.2e-7)


def test_centers_beyond_what_spz_holds_are_refused(tmp_path):
    table = unit_cloud(3, 0)
    table[0, 0] = 2**22 - 1
    write_splats(tmp_path / "cloud.spz", SplatFile(table))
    assert read_splats(tmp_path / "cloud.spz").table[0, 0] == 2**22 - 1
    table[0, 0] = 2**22
    with pytest.raises(BadRequest, match=r"cannot hold a center that is 4\.19e\+06 away") as caught:
        write_splats(tmp_path / "far.spz", SplatFile(table))
    assert ".ply" in caught.value.hint and not (tmp_path / "far.spz").exists()


def test_a_gltf_takes_no_name_of_others(tmp_path):
    (tmp_path / "cloud.bin").write_bytes(b"precious")
    first, second = SplatFile(unit_cloud(3, 0, 1)), SplatFile(unit_cloud(3, 0, 2))
    path = tmp_path / "cloud #1.gltf"
    write_splats(path, first)
    before = path.read_bytes()
    write_splats(path, second)
    assert np.array_equal(read_splats(path).table[:, :3], second.table[:, :3])
    assert len(list(tmp_path.glob("cloud #1.*.bin"))) == 1
    write_splats(path, first)
    assert path.read_bytes() == before
    assert (tmp_path / "cloud.bin").read_bytes() == b"precious"


def test_a_gltf_whose_writing_ends_before_its_time_is_the_old_one(tmp_path, monkeypatch):
    path, first = tmp_path / "cloud.gltf", SplatFile(unit_cloud(3, 0, 1))
    write_splats(path, first)
    written = gltf.atomic_write

    def ends_before(target, write):
        if target.suffix == ".gltf":
            raise KeyboardInterrupt
        written(target, write)

    monkeypatch.setattr(gltf, "atomic_write", ends_before)
    with pytest.raises(KeyboardInterrupt):
        write_splats(path, SplatFile(unit_cloud(3, 0, 2)))
    assert np.array_equal(read_splats(path).table[:, :3], first.table[:, :3])


def test_kinds_that_are_only_read_are_not_written(tmp_path):
    with pytest.raises(BadRequest, match=r"cloud\.sog has none of the ends \.compressed\.ply, \.ply"):
        write_splats(tmp_path / "cloud.sog", SplatFile(unit_cloud(3)))
