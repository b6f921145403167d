"""Command options and argument checks: valid values are accepted, wrong ones rejected by name."""

import dataclasses
import inspect
import json
from collections.abc import Callable
from dataclasses import MISSING
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import karf_engine as karf
from karf_engine.cli.verbs import make_parser, options_of
from karf_engine.commands.options import COMMANDS, MatchOptions, RenderOptions, options_of_job
from karf_engine.errors import BadRequest
from karf_engine.io.arguments import check_arguments, check_array, check_number, coerce, describe_type, format_value
from karf_engine.io.options import Options

CAPTURE, PROJECT, OUT = {"capture": "capture"}, {"project": "project"}, {"out": "out"}
REQUIRED = {  # each command's library function and its required options
    "poses": ("find_poses", {"photos": "photos"} | OUT),
    "import-splat": ("import_splat", {"splat": "scene.ply"} | OUT),
    "pinhole": ("convert_panoramas", CAPTURE | OUT),
    "inspect": ("inspect_capture", CAPTURE),
    "mark": ("mark", CAPTURE | {"view": "a", "object_name": "pot", "masks": "masks"}),
    "all": ("learn", CAPTURE | PROJECT | {"masks": "masks"}),
    "geometry": ("learn_geometry", CAPTURE | PROJECT),
    "segmentation": ("segment", PROJECT),
    "palette": ("extract_palettes", PROJECT),
    "recoloring": ("learn_recoloring", PROJECT),
    "splats": ("learn_splats", PROJECT),
    "erase": ("erase_splats", PROJECT | {"restore": True}),
    "match": (None, PROJECT | OUT | {"object": "pot", "source": "#ff0000", "target": "#00ff00"}),
    "render": ("render", PROJECT),
    "colorways": ("colorways", PROJECT | OUT | {"sheet": "sheet.csv"}),
    "points": ("write_points", PROJECT | OUT),
    "export-splat": ("export_splat", PROJECT | OUT),
    "export-page": ("export_page", PROJECT | OUT),
    "farm": ("learning_bundle", OUT | {"source": "project"}),
}


def rejection(kind, **values):
    with pytest.raises(BadRequest) as caught:
        kind.of(**values)
    return str(caught.value)


@pytest.mark.parametrize("command", COMMANDS)
def test_command_options_round_trip_and_reject_mistakes(command):
    kind, (_, needed) = COMMANDS[command], REQUIRED[command]
    for name in needed:
        assert name in rejection(kind, **{other: value for other, value in needed.items() if other != name})
    assert rejection(kind, **needed, thread=1) == "Unknown option thread. Did you mean threads?"
    options = kind.of(**needed, threads=2)
    assert kind.from_json(json.loads(json.dumps(options.to_json()))) == options
    positional = [needed[item.name] for item in dataclasses.fields(options) if item.metadata["positional"]]
    assert options_of(make_parser().parse_args([command, *positional, *options.to_arguments()])) == options


@pytest.mark.parametrize("command", COMMANDS.keys() - {"match"})
def test_library_function_documents_every_option(command):
    found = getattr(karf, REQUIRED[command][0])
    names = {item.name for item in dataclasses.fields(COMMANDS[command])} - {"source"}
    assert names <= set(inspect.signature(found).parameters)
    assert all(f"{name}:" in found.__doc__ for name in names)


def test_strings_become_paths_and_lists_become_tuples():
    options = RenderOptions.of(project="a", edit=["b.json", Path("c.json")], overrides=["render.edges=field"])
    assert options.project == Path("a") and options.edit == (Path("b.json"), Path("c.json"))
    assert options.overrides == ("render.edges=field",)


def test_job_of_an_earlier_version_is_accepted():
    values = {"views": "r_0", "edit": None, "out": None, "planes": True, "depth": False, "base": "photo", "threads": 2}
    options = options_of_job("render", Path("project"), values)
    assert (options.views, options.planes, options.base, options.out) == ("r_0", True, "photo", None)


@pytest.mark.parametrize(
    ("kind", "values", "words"),
    [
        (MatchOptions, {"project": "a", "out": "b", "view": "r_0"}, "no picture"),
        (MatchOptions, {"project": "a", "out": "b", "object": "pot", "source": "#ff0000"}, "no target"),
        (Options, {"threads": 0}, "out of range"),
        (Options, {"threads": 257}, "1 to 256"),
        (Options, {"threads": True}, "whole number"),
    ],
)
def test_inconsistent_or_out_of_range_values_are_rejected(kind, values, words):
    assert words in rejection(kind, **values)


@pytest.mark.parametrize(
    ("value", "kind", "from_python", "from_json"),
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
def test_values_are_checked_and_json_is_converted(value, kind, from_python, from_json):
    for wanted, is_json in ((from_python, False), (from_json, True)):
        found = coerce(value, kind, is_json)
        assert found is MISSING if wanted is MISSING else (found == wanted and type(found) is type(wanted))


def test_types_and_values_are_described_in_words():
    assert describe_type(int | None) == "a whole number or None"
    assert describe_type(tuple[str, ...]) == "a tuple, each a text"
    assert describe_type(tuple[float, float], is_json=True) == "a list of 2 values"
    assert describe_type(np.ndarray) == "an array" and describe_type(BadRequest) == "a BadRequest"
    assert format_value("r_003") == "'r_003'" and format_value("x" * 100) == "an object of type str"


@check_arguments
def double(number: int) -> int:
    return 2 * number


@pytest.mark.parametrize(
    ("check", "error", "words"),
    [
        (lambda: double("2"), TypeError, r"double takes a whole number as number, not '2'\."),
        (lambda: check_number("size", 0, 1), BadRequest, r"size = 0 is out of range\. Allowed: from 1\."),
        (
            lambda: check_array("points", np.zeros((2, 2)), ("n", 3)),
            BadRequest,
            r"points is an array of shape \(2, 2\)\. Give numbers \[n, 3\]\.",
        ),
        (lambda: coerce(["a\0"], tuple[Path, ...], is_json=True), BadRequest, "zero character"),
    ],
)
def test_wrong_arguments_give_readable_errors(check, error, words):
    assert double(2) == 4
    with pytest.raises(error, match=words):
        check()
