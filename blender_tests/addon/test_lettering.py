"""Labels are drawn as they are described: lines where they belong, later marks over earlier ones."""

import importlib
import sys

import numpy as np
import pytest


@pytest.fixture
def lettering(bpy):
    """The module that draws labels."""
    yield importlib.import_module("tools.procedural.lettering")
    for name in [name for name in sys.modules if name.startswith("tools.procedural")]:
        del sys.modules[name]


def drawn(lettering, *marks):
    """What the inks cover of a label 1 wide and 0.5 high, by their names."""
    inks = lettering.draw_label(lettering.Label(1.0, 0.5, marks))
    return dict(zip(lettering.INKS, np.moveaxis(inks, 2, 0), strict=True))


def middle_and_height(lettering, covered):
    """Where the covered pixels are, in label units: middle (u, v), and height."""
    rows, columns = (np.flatnonzero(covered.max(axis) > 0.5) for axis in (1, 0))
    left, right, top, bottom = columns[0], columns[-1] + 1, rows[0], rows[-1] + 1
    fineness = lettering.FINENESS
    middle = 0.5 * (left + right) / fineness - 0.5, 0.25 - 0.5 * (top + bottom) / fineness
    return middle, (bottom - top) / fineness


def test_a_line_of_capitals_has_its_height_and_its_middle_where_it_is_put(lettering):
    inks = drawn(lettering, lettering.Text("HIT", 0.1, -0.05, 0.2, bold=0.0))
    middle, height = middle_and_height(lettering, inks["colored"])
    assert middle == pytest.approx((0.1, -0.05), abs=0.004) and height == pytest.approx(0.2, abs=0.006)
    assert 0.1 < inks["colored"].mean() / (height * 0.5) < 0.9  # strokes, with gaps between them
    assert inks["dark"].max() == inks["foil"].max() == 0


def test_letters_in_paper_are_left_out_of_the_band_beneath_them(lettering):
    band = lettering.Area(-0.5, -0.1, 1.0, 0.2)
    plain = drawn(lettering, band)["colored"]
    assert plain.mean() == pytest.approx(0.4, abs=0.01)
    printed = drawn(lettering, band, lettering.Text("HIT", 0.0, 0.0, 0.12, "paper"))["colored"]
    missing = plain - printed
    middle, height = middle_and_height(lettering, missing)
    assert height == pytest.approx(0.12, abs=0.012) and middle == pytest.approx((0, 0), abs=0.006)


def test_a_bar_code_is_the_same_every_time_and_lies_in_its_rectangle(lettering):
    code = lettering.bars(-0.2, -0.1, 0.4, 0.2)
    assert code == lettering.bars(-0.2, -0.1, 0.4, 0.2)
    dark = drawn(lettering, *code)["dark"]
    middle, height = middle_and_height(lettering, dark)
    assert middle == pytest.approx((0, 0), abs=0.01) and height == pytest.approx(0.2, abs=0.006)
    assert 15 <= np.count_nonzero(np.diff(dark[len(dark) // 2] > 0.5)) // 2 <= 21
