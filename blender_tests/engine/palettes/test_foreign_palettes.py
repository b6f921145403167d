"""Palette files of other programs: written as their formats say, read back to the right swatches, refused in words."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from karf_engine.errors import DataError
from karf_engine.palettes.palette import Edit, Palette, read_edit
from karf_engine.palettes.palette_files import read_edit_file, write_edit_file

POT = Palette("pot", np.array([[0, 0, 0], [0.1, 1 / 3, 0.7], [1, 0.25, 0.5]], np.float32))
MUG = Palette("my mug", np.array([[0, 0, 0], [0.9, 0.8, 0.7]], np.float32))
EDIT = Edit({"pot": np.array([[0, 0, 0], [0.2, 0.4, 1 / 3], [0, 0, 1]], np.float32), "my mug": MUG.colors})


def ase(*blocks: bytes, count: int | None = None) -> bytes:
    return b"ASEF\0\1\0\0" + struct.pack(">I", len(blocks) if count is None else count) + b"".join(blocks)


def color_block(name: str, model: bytes, *values: float) -> bytes:
    text = name.encode("utf-16-be") + b"\0\0"
    content = struct.pack(">H", len(text) // 2) + text + model + struct.pack(f">{len(values)}fH", *values, 2)
    return struct.pack(">HI", 1, len(content)) + content


@pytest.mark.parametrize("suffix, tolerance", [(".gpl", 0.5 / 255), (".ase", 0), (".json", 0)])
def test_an_edit_comes_back(tmp_path: Path, suffix: str, tolerance: float) -> None:
    path = tmp_path / f"edit{suffix}"
    write_edit_file(path, EDIT)
    again = read_edit_file(path, [POT, MUG])
    for name, colors in EDIT.colors.items():
        np.testing.assert_allclose(again.colors[name], colors, atol=tolerance + 1e-7 * (tolerance > 0))


def test_a_gimp_palette_is_text_with_a_name_a_line(tmp_path: Path) -> None:
    write_edit_file(tmp_path / "blue.gpl", EDIT)
    assert (tmp_path / "blue.gpl").read_text().splitlines() == [
        "GIMP Palette",
        "Name: blue",
        "#",
        " 51 102  85\tpot 1",
        "  0   0 255\tpot 2",
        "230 204 178\tmy mug 1",
    ]


def test_a_swatch_exchange_file_has_a_group_an_object(tmp_path: Path) -> None:
    write_edit_file(tmp_path / "blue.ase", Edit({"ä": np.array([[0, 0, 0], [0.5, 1, 1.5]])}))
    group = struct.pack(">HIH", 0xC001, 6, 2) + "ä\0".encode("utf-16-be")
    assert (tmp_path / "blue.ase").read_bytes() == (
        ase(group, color_block("ä 1", b"RGB ", 0.5, 1, 1)[:-1] + b"\0", struct.pack(">HI", 0xC002, 0))
    )


def test_names_decide_and_what_is_not_named_stays_as_learned(tmp_path: Path) -> None:
    path = tmp_path / "some.gpl"
    path.write_text("GIMP Palette\nName: x\nColumns: 4\n# note\n\n0 0 255 my mug 1\n255 0 0\tpot 2\n")
    edit = read_edit_file(path, [POT, MUG], "paper")
    np.testing.assert_array_equal(edit.colors["my mug"][1], [0, 0, 1])
    np.testing.assert_array_equal(edit.colors["pot"], np.array([[0, 0, 0], POT.colors[1], [1, 0, 0]], np.float32))
    assert edit.compositing == "paper"


def test_colors_of_other_names_go_by_their_order(tmp_path: Path) -> None:
    path = tmp_path / "brand.ase"
    grey = color_block("ink", b"Gray", 0.5)
    path.write_bytes(ase(color_block("red", b"RGB ", 1, 0, 0), grey, color_block("red", b"RGB ", 0, 0, 1)))
    edit = read_edit_file(path, [POT, MUG])
    np.testing.assert_array_equal(edit.colors["pot"], [[0, 0, 0], [1, 0, 0], [0.5, 0.5, 0.5]])
    np.testing.assert_array_equal(edit.colors["my mug"], [[0, 0, 0], [0, 0, 1]])


@pytest.mark.parametrize(
    "lines, message",
    [
        ("1 2 3 red\n", "has 1 colors, none of which is named after a swatch; there are 3 swatches"),
        ("1 2 3 pot 1\n1 2 3 pot 9\n", "a color named 'pot 9'"),
        ("1 2 3 pot 1\n1 2 3 pot 1\n", "twice a color named 'pot 1'"),
        ("1 2 3 pot 0\n1 2 3 pot 1\n", "a color named 'pot 0'"),
        ("1 2 256 pot 1\n", "line 2 is not a color"),
        ("red pot 1\n", "line 2 is not a color"),
    ],
)
def test_a_palette_that_fits_no_swatches_is_refused(tmp_path: Path, lines: str, message: str) -> None:
    path = tmp_path / "bad.gpl"
    path.write_text(f"GIMP Palette\n{lines}")
    with pytest.raises(DataError, match=message):
        read_edit_file(path, [POT, MUG])


@pytest.mark.parametrize(
    "data, message",
    [
        (b"", "does not begin with ASEF"),
        (b"ASEF\0\2\0\0\0\0\0\0", "does not begin with ASEF"),
        (b"ASEF\0\1\0\0", "damaged"),
        (ase(count=4_000_000_000), "damaged"),
        (ase(struct.pack(">HI", 1, 4_000_000_000)), "ends behind the file's end"),
        (ase(struct.pack(">HIH", 1, 2, 60_000)), "damaged"),
        (ase(color_block("pot 1", b"CMYK", 0, 0, 0, 1)), "'pot 1' as CMYK, not as RGB"),
        (ase(color_block("pot 1", b"HSB ", 0.5, 0, 0)), "'pot 1' as HSB, not as RGB"),
        (ase(color_block("pot 1", b"RGB ", 0, float("nan"), 1)), "outside 0 to 1"),
    ],
)
def test_a_damaged_swatch_exchange_file_is_refused(tmp_path: Path, data: bytes, message: str) -> None:
    path = tmp_path / "bad.ase"
    path.write_bytes(data)
    with pytest.raises(DataError, match=message):
        read_edit_file(path, [POT, MUG])


@pytest.mark.parametrize("name", ["none.gpl", "none.ase", "folder.gpl", "huge.ase"])
def test_what_is_no_small_file_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "folder.gpl").mkdir()
    with (tmp_path / "huge.ase").open("wb") as stream:
        stream.truncate(1 << 30)
    with pytest.raises(DataError):
        read_edit_file(tmp_path / name, [POT])


def test_what_is_no_palette_file_is_read_as_json(tmp_path: Path) -> None:
    write_edit_file(tmp_path / "edit.JSON", EDIT)
    np.testing.assert_array_equal(read_edit(tmp_path / "edit.JSON", [POT, MUG]).colors["pot"], EDIT.colors["pot"])
