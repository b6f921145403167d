"""Values are checked against annotations: those of a program as they are, those of JSON converted."""

from collections.abc import Callable
from dataclasses import MISSING
from pathlib import Path
from typing import Any

import pytest

np = pytest.importorskip("numpy")

from karf_engine.errors import BadRequest
from karf_engine.io.arguments import check_arguments, check_array, check_number, coerce, describe_type, format_value


@pytest.mark.parametrize(
    ("value", "kind", "of_a_program", "of_json"),
    [
        (3, int, 3, 3),
        (True, int, MISSING, MISSING),
        (3, float, 3, 3.0),
        (2.5, int, MISSING, MISSING),
        (np.int64(3), int, np.int64(3), 3),
        ("a.png", Path, MISSING, Path("a.png")),
        ("", Path, MISSING, MISSING),
        ("a.png", str | Path, "a.png", "a.png"),
        (None, int | None, None, None),
        ([1, 2], tuple[float, float], MISSING, (1.0, 2.0)),
        ((1, 2), tuple[float, float], (1, 2), (1.0, 2.0)),
        ([1], tuple[float, float], MISSING, MISSING),
        ([["#fff", "#000"]], tuple[tuple[str, str], ...], MISSING, (("#fff", "#000"),)),
        ("ab", tuple[str, ...], MISSING, MISSING),
        ({"a": 1}, dict[str, int], {"a": 1}, {"a": 1}),
        ({"a": "b"}, dict[str, int], MISSING, MISSING),
        (["a", 1], list[str], MISSING, MISSING),
        (len, Callable[[list], int], len, len),
        (3, Any, 3, 3),
    ],
)
def test_what_fits_is_taken_and_json_is_converted(value, kind, of_a_program, of_json):
    for wanted, is_json in ((of_a_program, False), (of_json, True)):
        found = coerce(value, kind, is_json)
        assert found is MISSING if wanted is MISSING else (found == wanted and type(found) is type(wanted))


def test_a_zero_character_in_json_is_refused():
    with pytest.raises(BadRequest, match="zero character"):
        coerce(["a\0"], tuple[Path, ...], is_json=True)


def test_types_have_words():
    assert describe_type(int | None) == "a whole number or None"
    assert describe_type(tuple[str, ...]) == "a tuple, each a text"
    assert describe_type(tuple[float, float], is_json=True) == "a list of 2 values"
    assert describe_type(np.ndarray) == "an array" and describe_type(BadRequest) == "a BadRequest"


def test_a_decorated_function_takes_what_it_declares():
    @check_arguments
    def double(number: int) -> int:
        return 2 * number

    assert double(2) == 4
    with pytest.raises(TypeError, match=r"double takes a whole number as number, not '2'\."):
        double("2")


def test_numbers_and_arrays_are_refused_in_sentences():
    with pytest.raises(BadRequest, match=r"size = 0 is out of range\. Allowed: from 1\."):
        check_number("size", 0, 1)
    with pytest.raises(BadRequest, match=r"points is an array of shape \(2, 2\)\. Give numbers \[n, 3\]\."):
        check_array("points", np.zeros((2, 2)), ("n", 3))
    assert format_value("r_003") == "'r_003'" and format_value("x" * 100) == "an object of type str"
