"""Color books and sheets of colorways in every format, and errors that name file and line."""

import json
import struct

import numpy as np
import pytest

from blender_tests.engine.palettes.test_edit_files import ase, color_block
from karf_engine.errors import BadRequest, DataError
from karf_engine.io.color import ciede2000, srgb_to_lab
from karf_engine.palettes.color_books import ColorBook, nearest_names, read_color_book
from karf_engine.palettes.colorways import read_sheet

RGB, CMYK, LAB_SPACE = 0, 2, 7
HEAD = b"colorway,object,hex\n"
MINT = np.array([0x80, 0xD0, 0xA0]) / 255
LAB = srgb_to_lab(MINT)
BLACK = "x", b"\0\0\0"


@pytest.fixture
def write(tmp_path):
    """Write a file, unless its content is None, and return its path."""

    def write(name, content):
        path = tmp_path / name
        if content is not None:
            path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


def text(string):
    return struct.pack(">I", len(string)) + string.encode("utf-16-be")


def acb(*colors, space=RGB, version=1, prefix="", suffix=""):
    """An Adobe color book of names and the bytes of their colors."""
    head = b"8BCB" + struct.pack(">HH", version, 3000)
    names = [text(f"$$$/colorbook/INK/{key}={value}") for key, value in (("title", "Ink"), ("prefix", prefix))]
    counts = struct.pack(">4H", len(colors), 7, 3, space)
    rows = [text(name) + b"      " + values for name, values in colors]
    return b"".join([head, *names, text(suffix), text("for tests"), counts, *rows, b"spflspot"])


INK = acb(("1^R", b"\xff\0\0"), ("", b"\0\0\0"), ("2", b"\0\0\xff"), prefix="INK ", suffix=" C")
# sRGB's red under D50, the white of ICC profiles (Lindbloom's calculator)
RED_IN_BYTES, RED_D50 = bytes([round(54.29 * 2.55), 128 + 81, 128 + 70]), (0.5429, 80.81, 69.89)
RED, BLUE = (1.0, 0, 0), (0, 0, 1.0)


@pytest.mark.parametrize(
    ("name", "data", "names", "colors", "tolerance"),
    [
        ("ink.acb", INK, ("INK 1\u00ae C", "INK 2 C"), [RED, BLUE], 0.01),  # without the gap
        ("ink.acb", acb(("red", RED_IN_BYTES), space=LAB_SPACE), ("red",), [RED], 0.5),
        ("ink.ase", ase(color_block("red", b"LAB ", *RED_D50)), ("red",), [RED], 0.1),
        ("ink.csv", "Name;L;a;b\nRed;53,2408;80,0925;67,2032\nBlue;32,2970;79,1875;-107,8602\n", ("Red", "Blue"),
         [RED, BLUE], 0.01),
        ("ink.csv", "name\thex\tnote\nRed\t#ff0000\tx\nBlue\t#0000ff\t\n\n", ("Red", "Blue"), [RED, BLUE], 0.01),
        ("ink.gpl", "GIMP Palette\n0 0 255 Untitled\n0 0 255 untitled\n255 0 0\n",
         ("Untitled", "untitled (2)", "#ff0000"), [BLUE, BLUE, RED], 0.01),
    ],
)  # fmt: skip
def test_color_books_map_names_to_colors(write, name, data, names, colors, tolerance):
    book = read_color_book(write(name, data))
    assert (book.name, book.names) == ("ink", names)
    assert ciede2000(book.lab, srgb_to_lab(np.array(colors))).max() < tolerance
    found = [book[each.lower()] for each in names]
    assert {color.dtype.name for color in found} == {"float32"}
    np.testing.assert_allclose(found, colors, atol=0.02)


def test_nearest_names_differ_least_even_out_of_gamut():
    lab, color = srgb_to_lab(np.random.default_rng(3).random((500, 3))), np.array([0.7, 0.2, 0.1])
    found = nearest_names(ColorBook("all", tuple(map(str, range(500))), lab), color, 4)
    wanted = np.sort(ciede2000(lab, srgb_to_lab(color)))[:4]
    assert [each.ciede2000 for each in found] == pytest.approx(wanted.tolist())
    assert ciede2000(srgb_to_lab(np.stack([each.color for each in found])), srgb_to_lab(color)) == pytest.approx(wanted)
    wide = ColorBook("wide", ("Violet",), np.array([[60.0, 90, -90]]))
    (violet,) = nearest_names(wide, np.ones(3))
    assert violet.color.min() >= 0 and violet.color.max() <= 1 and nearest_names(wide, violet.color)[0].ciede2000 > 3


def test_unknown_name_is_rejected_with_the_nearest():
    book = ColorBook("RAL", ("RAL 5015", "RAL 9010"), np.zeros((2, 3)))
    assert book["ral5015"].tolist() == [0, 0, 0]
    with pytest.raises(BadRequest, match=r"RAL has no color 'RAL 5051'\. Its nearest name is 'RAL 5015'"):
        book["RAL 5051"]


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.acb", acb(("x", b"\0\0\0\0"), space=CMYK), "in CMYK: which colors these are depends on a printer's"),
        ("a.acb", acb(BLACK, space=1), "in HSB, not in RGB or Lab"),
        ("a.acb", acb(version=2), "of version 2; only version 1 is known"),
        ("a.acb", acb(BLACK)[:-12], "damaged"),
        ("a.acb", b"8BCB" + struct.pack(">HHI", 1, 1, 4_000_000_000), "a text ends behind the file's end"),
        ("a.acb", b"8BPS", "does not begin with 8BCB"),
        ("a.acb", acb(), "has 0 colors"),
        ("a.ase", ase(color_block("x", b"CMYK", 0, 0, 0, 1)), "'x' as CMYK, not as RGB or Lab"),
        ("a.ase", ase(color_block("x", b"LAB ", 0.5, float("nan"), 0)), "outside L"),
        ("a.gpl", "GIMP Palette\n", "has 0 colors"),
        ("a.csv", "name,hex\nRed,\n", "line 2 has no color"),
        ("a.csv", "ink,hex\nRed,#ff0000\n", "line 2 has no name"),
        ("a.csv", "name,hex\nRed,red\n", "'red' is not a color"),
        ("a.csv", "name,L,a,b\nRed,200,0,0\n", "L|lab color"),
        ("a.csv", b"name,hex\n\xff,#ff0000\n", "is not UTF-8 text"),
        ("a.txt", "", "is no color book"),
        *((f"gone{suffix}", None, "does not exist") for suffix in (".acb", ".ase", ".gpl", ".csv")),
    ],
)
def test_malformed_color_books_are_rejected(write, name, data, message):
    path = write(name, data)
    with pytest.raises(DataError, match=message):
        read_color_book(path)


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
def test_sheet_reads_every_color_notation(write, columns, cells):
    (colorway,) = read_sheet(write("spring.csv", f"colorway,object,{columns}\nMint,pot,{cells}\n"))
    (color,) = colorway.target_colors
    assert (colorway.name, color.name, color.source) == ("Mint", "pot", None)
    np.testing.assert_allclose(color.lab, LAB, atol=1e-4)


def test_semicolons_allow_decimal_commas(write):
    rows = "\ufeffcolorway;object;L*;a*;b*\nMint;pot;52,5;-30,25;12\nSky;pot;60;0;0\n\n;;;;\n"
    mint, sky = read_sheet(write("spring.csv", rows))
    assert mint.target_colors[0].lab.tolist() == [52.5, -30.25, 12] and sky.target_colors[0].lab.tolist() == [60, 0, 0]


def test_json_sheet_reads_like_csv(write):
    rows = [
        {"colorway": "Mint", "object": "pot", "srgb8": [128, 208, 160], "source_hex": "#ff0000"},
        {"colorway": "Mint", "object": "lid", "lab": LAB.tolist(), "hex": None},
    ]
    (colorway,) = read_sheet(write("spring.json", json.dumps(rows)))
    assert [color.name for color in colorway.target_colors] == ["pot", "lid"]
    np.testing.assert_allclose(colorway.target_colors[0].source, [1, 0, 0], atol=1e-6)
    np.testing.assert_allclose([color.lab for color in colorway.target_colors], [LAB, LAB], atol=1e-9)


def test_colorway_names_become_valid_folder_names(write):
    path = write("a.csv", "colorway,object,hex\nRAL 5010 / Enzian,pot,#004f7c\na:b,pot,#80d0a0\n")
    assert [colorway.folder for colorway in read_sheet(path)] == ["RAL 5010 _ Enzian", "a_b"]


def test_row_may_name_an_edit_file_beside_the_sheet(tmp_path, write):
    mint, look = read_sheet(write("a.csv", "colorway,object,hex,edit\nMint,pot,#80d0a0,\nA,,,edits/a.json\n"))
    assert mint.edit is None and look.edit == tmp_path / "edits" / "a.json" and not look.target_colors
    rows = [{"colorway": "A", "edit": "a.json"}]
    assert read_sheet(write("looks.json", json.dumps(rows)))[0].edit == tmp_path / "a.json"


@pytest.mark.parametrize(
    ("rows", "sentence"),
    [
        ("Sky,pot,#80a0d0,\nMint,,#80d0a0,", "line 3 has no object"),
        ("Sky,pot,#80a0d0,\n,pot,#80d0a0,", "line 3 has no colorway"),
        ("Sky,pot,#80a0d0,\nMint,pot,,", "line 3 has no color"),
        ("Sky,pot,#80a0d0,\nMint,pot,mint,", "line 3: 'mint' is not a color"),
        ("Sky,pot,#80a0d0,\nMint,pot,,1 2", "line 3 has the lab color '1 2'"),
        ("Sky,pot,#80a0d0,\nMint,pot,,120 0 0", "line 3 has the lab color '120 0 0'"),
        ("Sky,pot,#80a0d0,\nMint,pot,,50 nan 0", "line 3 has the lab color '50 nan 0'"),
        ("Sky,pot,#80a0d0,\nMint,pot,#80d0a0,50 0 0", "line 3 has a color as hex and as lab"),
        ("Sky,pot,#80a0d0,\nSky,pot,#80d0a0,", "line 3: 'Sky' has two colors of 'pot'"),
        ("Sky,pot,#80a0d0,\nsky,pot,#80d0a0,", "line 3: 'sky' and 'Sky' would share a folder"),
        ("A,,,,a.json\nA,,,,b.json", "line 3: 'A' is an edit and has another row"),
        ("A,,,,a.json\nA,pot,#000000,,", "line 3: 'A' is an edit and has another row"),
        ("A,pot,#000000,,\nA,,,,a.json", "line 3: 'A' is an edit and has another row"),
    ],
)
def test_wrong_row_is_rejected_with_its_line_and_value(write, rows, sentence):
    path = write("spring.csv", f"colorway,object,hex,lab,edit\n{rows}\n")
    with pytest.raises(DataError) as caught:
        read_sheet(path)
    assert sentence in caught.value.sentence and str(path) in caught.value.sentence and caught.value.hint


@pytest.mark.parametrize(
    ("name", "content"),
    [
        *(("a.csv", each) for each in (b"", HEAD, HEAD + b"M\xfcnze,pot,#80d0a0\n", b"\x00\x01\x02\n\x00")),
        *(("a.json", each) for each in ("{}", "[1]", '[{"colorway": 3, "object": "pot", "hex": "#000000"}]')),
        *(("a.json", f'[{{"colorway": "M", "object": "pot", "lab": {each}}}]') for each in ("[1, 2, {}]", 7)),
        ("gone.csv", None),
    ],
)
def test_malformed_sheets_are_rejected(write, name, content):
    path = write(name, content)
    with pytest.raises(DataError, match=name):
        read_sheet(path)
