"""Plain PLY files as many programs write them, and rewritten without a foreign byte changed."""

import tracemalloc

import numpy as np
import pytest

from blender_tests.engine.splats.formats.files import unit_cloud, write_text
from karf_engine.errors import DataError
from karf_engine.splats.formats import ply
from karf_engine.splats.formats.splat_file import SplatFile

COLUMNS = {"label": np.arange(20, dtype=np.uint8), "weight": np.linspace(0, 1, 20)}


def foreign(path, order="<", line_end="\n", kind="f4", more=b""):
    """A file of another program: properties in another order, further ones between, comments, an element behind."""
    table = unit_cloud(20, 1)
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
    path.write_bytes(line_end.join(lines).encode() + rows.tobytes() + b"\x07" + more)
    return table


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
@pytest.mark.parametrize("kind", ["f4", "f8"])
def test_other_programs_files_are_read_and_rewritten(order, line_end, kind, tmp_path):
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


def test_only_what_changes_is_written(tmp_path):
    path = tmp_path / "cloud.ply"
    table = foreign(path, kind="f8")
    before = np.frombuffer(path.read_bytes(), np.uint8).copy()
    table[7, 11] += 1
    ply.rewrite(ply.open_original(path), path, table)
    assert 0 < np.count_nonzero(before != np.frombuffer(path.read_bytes(), np.uint8)) <= 8


def test_text_is_read_but_not_rewritten(tmp_path):
    path = tmp_path / "cloud.ply"
    table = unit_cloud(2, 0)
    write_text(path, table)
    assert np.array_equal(ply.read(path).table, table)
    with pytest.raises(DataError, match=r"cloud\.ply is a PLY file of text"):
        ply.rewrite(ply.open_original(path), path, table)


def test_a_text_takes_the_room_of_its_numbers_and_not_of_its_words(tmp_path):
    path, count = tmp_path / "cloud.ply", 40_000
    names = "".join(f"property float {name}\n" for name in ply.property_names(14))
    row = " ".join(["1.5"] * 14)
    path.write_text(
        f"ply\nformat ascii 1.0\nelement camera 1\nproperty float id\nelement vertex {count}\n{names}end_header\n7\n"
        + f"{row}\n" * count
    )
    tracemalloc.start()
    table = ply.read(path).table
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert table.shape == (count, 14) and (table == 1.5).all()
    assert peak < path.stat().st_size + 30 * table.size, "as words they would take forty bytes a number more"


def test_a_text_that_is_cut_off_or_has_words_is_refused(tmp_path):
    path = tmp_path / "cloud.ply"
    names = "".join(f"property float {name}\n" for name in ply.property_names(14))
    for row, words in (("1 " * 13, "2 rows do not fit into its 13 numbers"), ("x " * 28, "its rows are not numbers")):
        path.write_text(f"ply\nformat ascii 1.0\nelement vertex 2\n{names}end_header\n{row}")
        with pytest.raises(DataError, match=words):
            ply.read(path)


def test_columns_are_kept_in_their_types(tmp_path):
    ply.write(tmp_path / "cloud.ply", SplatFile(unit_cloud(20, 2), False, COLUMNS))
    found = ply.read(tmp_path / "cloud.ply")
    assert {name: column.dtype for name, column in found.columns.items()} == {"label": np.uint8, "weight": np.float64}
    assert all(np.array_equal(found.columns[name], COLUMNS[name]) for name in COLUMNS)


def test_a_table_of_another_shape_is_refused(tmp_path):
    foreign(tmp_path / "cloud.ply")
    with pytest.raises(ValueError, match=r"\(20, 14\) for a file of \(20, 23\)"):
        ply.rewrite(ply.open_original(tmp_path / "cloud.ply"), tmp_path / "out.ply", unit_cloud(20, 0))


def test_a_type_that_ply_has_not_is_refused(tmp_path):
    with pytest.raises(ValueError, match="PLY has no type i8"):
        ply.write(tmp_path / "cloud.ply", SplatFile(unit_cloud(20, 0), columns={"label": np.arange(20)}))
