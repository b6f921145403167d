"""Color books: every format gives its names their colors, and what is no book is refused in words."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from blender_tests.engine.palettes.test_foreign_palettes import ase, color_block
from karf_engine.errors import BadRequest, DataError
from karf_engine.io.color import ciede2000, lab_d50_to_d65, srgb_to_lab
from karf_engine.palettes.color_books import ColorBook, nearest_names, read_color_book
from karf_engine.palettes.palette import Palette
from karf_engine.palettes.palette_files import read_edit_file

RGB, CMYK, LAB = 0, 2, 7
# sRGB's red as ICC profiles tell it, whose white is D50 (Lindbloom's calculator)
RED_D50 = np.array([54.29, 80.81, 69.89])


def text(string: str) -> bytes:
    return struct.pack(">I", len(string)) + string.encode("utf-16-be")


def acb(*colors: tuple[str, bytes], space: int = RGB, version: int = 1, prefix: str = "", suffix: str = "") -> bytes:
    head = b"8BCB" + struct.pack(">HH", version, 3000)
    names = [text(f"$$$/colorbook/INK/{key}={value}") for key, value in (("title", "Ink"), ("prefix", prefix))]
    counts = struct.pack(">4H", len(colors), 7, 3, space)
    rows = [text(name) + b"      " + values for name, values in colors]
    return b"".join([head, *names, text(suffix), text("for tests"), counts, *rows, b"spflspot"])


def written(folder: Path, name: str, data: bytes | str) -> Path:
    path = folder / name
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


def test_a_color_book_in_rgb_has_prefix_and_suffix_and_leaves_gaps_out(tmp_path: Path) -> None:
    data = acb(("1^R", b"\xff\0\0"), ("", b"\0\0\0"), ("2", b"\0\0\xff"), prefix="INK ", suffix=" C")
    book = read_color_book(written(tmp_path, "ink.acb", data))
    assert (book.name, book.names) == ("ink", ("INK 1\u00ae C", "INK 2 C"))
    assert book["INK 2 C"].tolist() == pytest.approx([0, 0, 1], abs=1e-7) and book["INK 2 C"].dtype == np.float32


def test_labs_of_adobe_have_another_white(tmp_path: Path) -> None:
    values = bytes([round(54.29 * 2.55), 128 + 81, 128 + 70])
    books = [
        read_color_book(written(tmp_path, "ink.acb", acb(("red", values), space=LAB))),
        read_color_book(written(tmp_path, "ink.ase", ase(color_block("red", b"LAB ", 0.5429, 80.81, 69.89)))),
    ]
    for book, tolerance in zip(books, (0.5, 0.1), strict=True):
        assert ciede2000(book.lab[0], srgb_to_lab(np.array([1.0, 0, 0]))) < tolerance
    assert ciede2000(RED_D50, srgb_to_lab(np.array([1.0, 0, 0]))) > 1  # what taking them as ours would cost


def test_greys_stay_grey_from_white_to_white() -> None:
    greys = np.stack([np.linspace(0, 100, 9), np.zeros(9), np.zeros(9)], axis=1)
    np.testing.assert_allclose(lab_d50_to_d65(greys), greys, atol=1e-9)


@pytest.mark.parametrize(
    "table",
    [
        "name,hex\nRed,#ff0000\nBlue,#0000ff\n",
        "Name;L;a;b\nRed;53,2408;80,0925;67,2032\nBlue;32,2970;79,1875;-107,8602\n",
        "name\tL*\ta*\tb*\nRed\t53.2408\t80.0925\t67.2032\nBlue\t32.2970\t79.1875\t-107.8602\n",
        "name,R,G,B,note\nRed,255,0,0,x\nBlue,0,0,255,\n\n",
    ],
)
def test_a_table_names_colors_as_a_sheet_of_colorways_does(tmp_path: Path, table: str) -> None:
    book = read_color_book(written(tmp_path, "inks.csv", table))
    assert book.names == ("Red", "Blue")
    np.testing.assert_allclose([book["red"], book["BLUE"]], [[1, 0, 0], [0, 0, 1]], atol=1e-4)


def test_a_gimp_palette_is_a_book_too_and_each_name_is_another(tmp_path: Path) -> None:
    book = read_color_book(written(tmp_path, "a.gpl", "GIMP Palette\n9 9 9 Untitled\n8 8 8 untitled\n7 7 7\n"))
    assert book.names == ("Untitled", "untitled (2)", "#070707")


def test_the_nearest_names_are_those_of_least_difference() -> None:
    lab = srgb_to_lab(np.random.default_rng(3).random((500, 3)))
    book, color = ColorBook("all", tuple(map(str, range(500))), lab), np.array([0.7, 0.2, 0.1])
    found = nearest_names(book, color, 4)
    wanted = np.sort(ciede2000(lab, srgb_to_lab(color)))[:4]
    assert [each.ciede2000 for each in found] == pytest.approx(wanted.tolist())
    assert all(
        ciede2000(srgb_to_lab(each.color), srgb_to_lab(color)) == pytest.approx(each.ciede2000) for each in found
    )


def test_a_color_that_no_screen_shows_keeps_its_own_difference() -> None:
    book = ColorBook("wide", ("Violet",), np.array([[60.0, 90, -90]]))
    (violet,) = nearest_names(book, np.array([1.0, 1, 1]))
    assert violet.color.min() >= 0 and violet.color.max() <= 1
    (itself,) = nearest_names(book, violet.color)
    assert itself.ciede2000 > 3


def test_a_name_that_is_none_is_refused_with_the_nearest() -> None:
    book = ColorBook("RAL", ("RAL 5015", "RAL 9010"), np.zeros((2, 3)))
    assert book["ral5015"].tolist() == [0, 0, 0]
    with pytest.raises(BadRequest, match=r"RAL has no color 'RAL 5051'\. Its nearest name is 'RAL 5015'"):
        book["RAL 5051"]


@pytest.mark.parametrize(
    "name, data, message",
    [
        (
            "a.acb",
            acb(("x", b"\0\0\0\0"), space=CMYK),
            "in CMYK: which colors these are depends on a printer's profile",
        ),
        ("a.acb", acb(("x", b"\0\0\0"), space=1), "in HSB, not in RGB or Lab"),
        ("a.acb", acb(version=2), "of version 2; only version 1 is known"),
        ("a.acb", acb(("x", b"\0\0\0"))[:-12], "damaged"),
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
    ],
)
def test_what_is_no_book_is_refused(tmp_path: Path, name: str, data: bytes | str, message: str) -> None:
    with pytest.raises(DataError, match=message):
        read_color_book(written(tmp_path, name, data))


@pytest.mark.parametrize("suffix", [".acb", ".ase", ".gpl", ".csv"])
def test_a_book_that_is_gone_is_refused(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(DataError, match="does not exist"):
        read_color_book(tmp_path / f"gone{suffix}")


def test_swatches_in_lab_are_read_as_an_edit_within_srgb(tmp_path: Path) -> None:
    path = written(tmp_path, "edit.ase", ase(color_block("pot 1", b"LAB ", 0.6, 90, -90)))
    edit = read_edit_file(path, [Palette("pot", np.array([[0, 0, 0], [0.5, 0.5, 0.5]], np.float32))])
    assert edit.colors["pot"][1].max() <= 1 and edit.colors["pot"][1].min() >= 0
