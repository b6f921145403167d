"""A written .sog is read again, by us and by the program of those who defined it, within the format's precision."""

import shutil
import subprocess
import zipfile

import numpy as np
import pytest

from blender_tests.engine.splats.formats.files import distances, require_package, unit_cloud
from karf_engine.splats.formats import sog
from karf_engine.splats.formats.packed import morton_order
from karf_engine.splats.formats.registry import arrays_of, read_splats, write_splats
from karf_engine.splats.formats.splat_file import SplatFile

# of values in [-4, -1.5], and of normal ones with a deviation of 0.3, each coded by 256 numbers
PRECISION = {"center": 4e-5, "scales": 0.01, "rotation": 0.008, "opacity": 1 / 500, "color": 0.02, "harmonics": 0.02}
TRANSFORM = shutil.which("splat-transform")


def written(path, table, is_antialiased=None):
    require_package(".sog")
    write_splats(path, SplatFile(table, is_antialiased))
    return path


def too_far(found, table):
    far = distances(found, table[morton_order(table)])
    return {name: value for name, value in far.items() if value > PRECISION[name]}


@pytest.mark.parametrize("degree", range(4))
def test_sog_round_trips(degree, tmp_path):
    table = unit_cloud(700, degree)
    found = arrays_of(written(tmp_path / "cloud.sog", table, True))
    assert too_far(found["table"], table) == {} and found["is_antialiased"].tolist() == [True]


def test_rare_and_equal_values_are_kept(tmp_path):
    table = unit_cloud(700, 0)
    table[:, 4], table[5, 3], table[6, 2] = -2, -87, 1000
    found = arrays_of(written(tmp_path / "cloud.sog", table))["table"]
    order = morton_order(table)
    np.testing.assert_allclose(found[:, 4], -2, atol=0.2)
    np.testing.assert_allclose(found[:, 3], table[order, 3], atol=0.4)
    np.testing.assert_allclose(found[:, :2], table[order, :2], atol=1e-4)


@pytest.mark.parametrize("count", [1, 5])
def test_few_gaussians_are_written(count, tmp_path):
    table = unit_cloud(count, 1)
    assert too_far(arrays_of(written(tmp_path / "cloud.sog", table))["table"], table) == {}


def test_alike_harmonics_share_an_entry(tmp_path, monkeypatch):
    monkeypatch.setattr(sog, "PALETTE", 64)
    monkeypatch.setattr(sog, "GROUPS", 4)
    table = unit_cloud(600, 2)
    table[:, 14:] = np.repeat(table[:30, 14:], 20, 0)
    found = arrays_of(written(tmp_path / "cloud.sog", table))["table"]
    rest = np.abs(found[:, 14:] - table[morton_order(table), 14:]).max(1)
    assert np.mean(rest < 0.02) > 0.8 and len(np.unique(found[:, 14:], axis=0)) <= 64


def test_the_same_gaussians_give_the_same_bytes(tmp_path):
    first, second = (written(tmp_path / name, unit_cloud(50, 1)) for name in ("a.sog", "b.sog"))
    assert first.read_bytes() == second.read_bytes()
    assert zipfile.ZipFile(first).testzip() is None


@pytest.mark.skipif(TRANSFORM is None, reason="needs the command of @playcanvas/splat-transform")
def test_sog_by_splat_transform(tmp_path):
    table = unit_cloud(700, 3)
    path = written(tmp_path / "cloud.sog", table)
    subprocess.run([TRANSFORM, path, tmp_path / "cloud.ply"], check=True, capture_output=True, timeout=300)
    assert too_far(read_splats(tmp_path / "cloud.ply").table, table) == {}
