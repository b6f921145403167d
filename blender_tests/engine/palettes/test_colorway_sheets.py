"""Sheets of colorways: every way to write a color, and errors that name the line."""

import json
from pathlib import Path

import numpy as np
import pytest

from karf_engine.errors import DataError
from karf_engine.io.color import srgb_to_lab
from karf_engine.palettes.colorways import read_sheet

MINT = np.array([0x80, 0xD0, 0xA0]) / 255


def write(folder: Path, text: str, name: str = "spring.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


LAB = srgb_to_lab(MINT)


@pytest.mark.parametrize(
    ("columns", "cells"),
    [
        ("hex", "#80d0a0"),
        ("HEX", " 80D0A0 "),
        ("lab", '"{:.6f}, {:.6f}, {:.6f}"'.format(*LAB)),
        ("lab", "{:.6f} {:.6f} {:.6f}".format(*LAB)),
        ("L*,a*,b*", "{:.6f},{:.6f},{:.6f}".format(*LAB)),
        ("srgb8", "128 208 160"),
        ("R,G,B", "128,208,160"),
        ("srgb", "{:.6f} {:.6f} {:.6f}".format(*MINT)),
        ("hex,lab,supplier", "#80d0a0,,Farben Meier"),
    ],
)
def test_a_color_may_be_written_in_every_way(tmp_path, columns, cells):
    path = write(tmp_path, f"colorway,object,{columns}\nMint,pot,{cells}\n")
    ((colorway,), (target_color,)) = (sheet := read_sheet(path)), sheet[0].target_colors
    assert (colorway.name, target_color.name, target_color.source) == ("Mint", "pot", None)
    np.testing.assert_allclose(target_color.lab, LAB, atol=1e-4)


def test_semicolons_go_with_decimal_commas_as_spreadsheets_of_many_countries_write_them(tmp_path):
    path = write(tmp_path, "\ufeffcolorway;object;L*;a*;b*\nMint;pot;52,5;-30,25;12\nSky;pot;60;0;0\n\n;;;;\n")
    mint, sky = read_sheet(path)
    assert mint.target_colors[0].lab.tolist() == [52.5, -30.25, 12] and sky.target_colors[0].lab.tolist() == [60, 0, 0]


def test_a_json_sheet_says_the_same(tmp_path):
    rows = [
        {"colorway": "Mint", "object": "pot", "srgb8": [128, 208, 160], "source_hex": "#ff0000"},
        {"colorway": "Mint", "object": "lid", "lab": LAB.tolist(), "hex": None},
    ]
    (colorway,) = read_sheet(write(tmp_path, json.dumps(rows), "spring.json"))
    assert [target_color.name for target_color in colorway.target_colors] == ["pot", "lid"]
    np.testing.assert_allclose(colorway.target_colors[0].source, [1, 0, 0], atol=1e-6)
    for target_color in colorway.target_colors:
        np.testing.assert_allclose(target_color.lab, LAB, atol=1e-9)


def test_names_become_names_of_folders(tmp_path):
    path = write(tmp_path, "colorway,object,hex\nRAL 5010 / Enzian,pot,#004f7c\n")
    assert read_sheet(path)[0].folder == "RAL 5010 _ Enzian"


@pytest.mark.parametrize(
    ("row", "sentence"),
    [
        ("Mint,,#80d0a0,", "line 3 has no object"),
        (",pot,#80d0a0,", "line 3 has no colorway"),
        ("Mint,pot,,", "line 3 has no color"),
        ("Mint,pot,mint,", "line 3: 'mint' is not a color"),
        ("Mint,pot,,1 2", "line 3 has the lab color '1 2'"),
        ("Mint,pot,,120 0 0", "line 3 has the lab color '120 0 0'"),
        ("Mint,pot,,50 nan 0", "line 3 has the lab color '50 nan 0'"),
        ("Mint,pot,#80d0a0,50 0 0", "line 3 has a color as hex and as lab"),
        ("Sky,pot,#80d0a0,", "line 3: 'Sky' has two colors of 'pot'"),
        ("sky,pot,#80d0a0,", "line 3: 'sky' and 'Sky' would share a folder"),
        ("a:b,pot,#80d0a0,", ""),
    ],
)
def test_an_error_names_the_line_and_the_value(tmp_path, row, sentence):
    path = write(tmp_path, f"colorway,object,hex,lab\nSky,pot,#80a0d0,\n{row}\n")
    if not sentence:
        assert len(read_sheet(path)) == 2
        return
    with pytest.raises(DataError) as caught:
        read_sheet(path)
    assert sentence in caught.value.sentence and str(path) in caught.value.sentence and caught.value.hint


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.csv", b""),
        ("a.csv", b"colorway,object,hex\n"),
        ("a.csv", b"colorway,object,hex\nM\xfcnze,pot,#80d0a0\n"),
        ("a.csv", b"\x00\x01\x02\n\x00"),
        ("a.json", b"{}"),
        ("a.json", b"[1]"),
        ("a.json", b'[{"colorway": 3, "object": "pot", "hex": "#000000"}]'),
        ("a.json", b'[{"colorway": "M", "object": "pot", "lab": [1, 2, {}]}]'),
        ("a.json", b'[{"colorway": "M", "object": "pot", "lab": 7}]'),
    ],
)
def test_what_is_no_sheet_is_told(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DataError, match=name):
        read_sheet(tmp_path / name)


def test_a_missing_sheet_is_told(tmp_path):
    with pytest.raises(DataError, match="does not exist"):
        read_sheet(tmp_path / "no.csv")


def test_a_row_may_be_an_edit_beside_the_sheet(tmp_path):
    path = write(tmp_path, "colorway,object,hex,edit\nMint,pot,#80d0a0,\nA,,,edits/a.json\n")
    mint, look = read_sheet(path)
    assert mint.edit is None and look.edit == tmp_path / "edits" / "a.json" and not look.target_colors
    rows = [{"colorway": "A", "edit": "a.json"}]
    assert read_sheet(write(tmp_path, json.dumps(rows), "looks.json"))[0].edit == tmp_path / "a.json"


@pytest.mark.parametrize(
    "rows", ["A,,,a.json\nA,,,b.json\n", "A,,,a.json\nA,pot,#000000,\n", "A,pot,#000000,\nA,,,a.json\n"]
)
def test_an_edit_is_a_colorway_alone(tmp_path, rows):
    with pytest.raises(DataError, match="line 3: 'A' is an edit and has another row"):
        read_sheet(write(tmp_path, f"colorway,object,hex,edit\n{rows}"))
