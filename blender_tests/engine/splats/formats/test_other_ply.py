"""PLY files of Mip-Splatting and of 2D Gaussian Splatting are read as what they stand for, and written back as they were."""

import numpy as np
import pytest

from blender_tests.engine.splats.formats import files
from karf_engine.errors import DataError
from karf_engine.splats.formats import ply
from karf_engine.splats.formats.splat_file import SplatFile


def write_without(path, table, *left_out, **more):
    """A binary .ply with columns in the order of `property_names`, some left out and some added."""
    values = dict(zip(ply.property_names(table.shape[1]), table.T, strict=True)) | more
    names = [name for name in values if name not in left_out]
    rows = np.zeros(len(table), [(name, "<f4") for name in names])
    for name in names:
        rows[name] = values[name]
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(table)}",
             *(f"property float {name}" for name in names), "end_header", ""]  # fmt: skip
    path.write_bytes("\n".join(lines).encode() + rows.tobytes())


def fused(table, sizes):
    """As GaussianModel.save_fused_ply of Mip-Splatting does, in double precision."""
    scales, opacities = np.exp(table[:, 3:6].astype(float)), 1 / (1 + np.exp(-table[:, 10].astype(float)))
    squares, widened = scales**2, scales**2 + sizes[:, None] ** 2
    opacities = opacities * np.sqrt(squares.prod(1) / widened.prod(1))
    return np.log(np.sqrt(widened)), np.log(opacities / (1 - opacities))


@pytest.mark.opens("splat", "Mip-Splatting", "`.ply` with `filter_3D`", "the filter is fused; columns are kept")
@pytest.mark.parametrize("degree", range(4))
def test_filter_of_mip_splatting_is_fused(degree, tmp_path):
    table, sizes = files.unit_cloud(50, degree), np.linspace(0, 0.3, 50)
    write_without(tmp_path / "mip.ply", table, filter_3D=sizes)
    found = ply.read(tmp_path / "mip.ply")
    scales, logits = fused(table, sizes.astype(np.float32).astype(float))
    np.testing.assert_allclose(found.table[:, 3:6], scales, atol=1e-5)
    np.testing.assert_allclose(found.table[:, 10], logits, atol=1e-5)
    assert np.array_equal(np.delete(found.table, [3, 4, 5, 10], 1), np.delete(table, [3, 4, 5, 10], 1))
    assert found.columns == {}, "else a file of fused Gaussians would be fused again"


def test_file_of_mip_splatting_keeps_its_columns(tmp_path):
    path, out, table = tmp_path / "mip.ply", tmp_path / "out.ply", files.unit_cloud(20, 3)
    write_without(path, table, filter_3D=np.full(20, 0.1))
    original = ply.open_original(path)
    ply.rewrite(original, out, original.splats.table)
    assert out.read_bytes() == path.read_bytes()
    changed = original.splats.table.copy()
    changed[4, 11:] += 0.25
    ply.rewrite(original, out, changed)
    assert np.array_equal(ply.read(out).table, changed)
    changed[4, 10] += 1
    with pytest.raises(ValueError, match=r"opacity of .* is not stored as it is read"):
        ply.rewrite(original, out, changed)


@pytest.mark.opens(
    "splat", "2D Gaussian Splatting", "`.ply` with two scales", "flat Gaussians; written back as they were"
)
@pytest.mark.parametrize("degree", [0, 2, 3])
def test_2dgs_gaussians_are_flat_and_written_back_unchanged(degree, tmp_path):
    path, out, table = tmp_path / "flat.ply", tmp_path / "out.ply", files.unit_cloud(20, degree)
    table[3, 0] = np.nan
    write_without(path, table, "scale_2")
    original = ply.open_original(path)
    table[:, 5] = np.log(1e-6)
    assert np.array_equal(original.splats.table, np.delete(table, 3, 0))
    ply.rewrite(original, out, original.splats.table)
    assert out.read_bytes() == path.read_bytes()
    changed = original.splats.table.copy()
    changed[:, 11:14] = 0.5
    ply.rewrite(original, out, changed)
    assert b"scale_2" not in out.read_bytes() and np.array_equal(ply.read(out).table, changed)
    changed[0, 5] = 0
    with pytest.raises(ValueError, match=r"scale_2 of .* is not stored as it is read"):
        ply.rewrite(original, out, changed)


def test_flat_gaussians_with_a_filter_stay_visible(tmp_path):
    table = files.unit_cloud(5, 0)
    write_without(tmp_path / "flat.ply", table, "scale_2", filter_3D=np.full(5, 0.01))
    found = ply.read(tmp_path / "flat.ply").table
    np.testing.assert_allclose(found[:, 5], np.log(1e-6))
    assert (found[:, 10] > table[:, 10] - 1).all()


def test_table_of_flat_gaussians_is_written_with_three_scales(tmp_path):
    table = files.unit_cloud(5, 0)
    write_without(tmp_path / "flat.ply", table, "scale_2")
    ply.write(tmp_path / "cut.ply", SplatFile(ply.read(tmp_path / "flat.ply").table[:2]))
    np.testing.assert_allclose(ply.read(tmp_path / "cut.ply").table[:, 5], np.log(1e-6))


def test_other_scales_are_still_required(tmp_path):
    write_without(tmp_path / "flat.ply", files.unit_cloud(5, 0), "scale_1", "scale_2")
    with pytest.raises(DataError, match="have no scale_1"):
        ply.read(tmp_path / "flat.ply")
