"""Options of commands and values of any type: what fits is taken, what does not is refused by name in every way in."""

import dataclasses
import inspect
import json
from collections.abc import Callable
from dataclasses import MISSING
from pathlib import Path
from typing import Any

import pytest

np = pytest.importorskip("numpy")

import karf_engine as karf
from karf_engine.cli.verbs import make_parser, options_of
from karf_engine.commands.options import COMMANDS, MatchOptions, RenderOptions, options_of_job
from karf_engine.errors import BadRequest
from karf_engine.io.arguments import check_arguments, check_array, check_number, coerce, describe_type, format_value
from karf_engine.io.options import Options

NEEDED = {  # the least that each command takes
    "poses": {"photos": "photos", "out": "out"},
    "import-splat": {"splat": "scene.ply", "out": "out"},
    "inspect": {"capture": "capture"},
    "mark": {"capture": "capture", "view": "a", "object_name": "pot", "masks": "masks"},
    "all": {"capture": "capture", "project": "project", "masks": "masks"},
    "geometry": {"capture": "capture", "project": "project"},
    "segmentation": {"project": "project"},
    "palette": {"project": "project"},
    "recoloring": {"project": "project"},
    "splats": {"project": "project"},
    "match": {"project": "project", "object": "pot", "source": "#ff0000", "target": "#00ff00", "out": "edit.json"},
    "render": {"project": "project"},
    "colorways": {"project": "project", "sheet": "sheet.csv", "out": "out"},
    "points": {"project": "project", "out": "points.ply"},
    "export-splat": {"project": "project", "out": "scene.ply"},
    "farm": {"source": "project", "out": "out"},
}
FUNCTIONS = {
    "find_poses": "poses", "import_splat": "import-splat", "inspect_capture": "inspect", "mark": "mark", "learn": "all",
    "learn_geometry": "geometry", "segment": "segmentation", "extract_palettes": "palette", "render": "render",
    "learn_recoloring": "recoloring", "learn_splats": "splats", "colorways": "colorways", "write_points": "points",
    "export_splat": "export-splat", "learning_bundle": "farm",
}  # fmt: skip
every_command = pytest.mark.parametrize("command", COMMANDS)


def refused(kind, **values):
    with pytest.raises(BadRequest) as caught:
        kind.of(**values)
    return str(caught.value)


@every_command
def test_the_least_that_a_command_takes_is_enough_and_nothing_of_it_can_be_left_out(command):
    kind, needed = COMMANDS[command], NEEDED[command]
    kind.of(**needed)
    for name in needed:
        message = refused(kind, **{other: value for other, value in needed.items() if other != name})
        assert name in message


@every_command
def test_a_misspelled_option_is_refused_with_the_nearest_name(command):
    assert refused(COMMANDS[command], **NEEDED[command], thread=1) == "Unknown option thread. Did you mean threads?"


@every_command
def test_options_survive_the_way_through_json_and_through_the_command_line(command):
    options = COMMANDS[command].of(**NEEDED[command], threads=2)
    assert COMMANDS[command].from_json(json.loads(json.dumps(options.to_json()))) == options
    positional = [NEEDED[command][item.name] for item in dataclasses.fields(options) if item.metadata["positional"]]
    assert options_of(make_parser().parse_args([command, *positional, *options.to_arguments()])) == options


@pytest.mark.parametrize(("function", "command"), FUNCTIONS.items())
def test_a_function_of_the_library_shows_and_explains_every_option(function, command):
    found = getattr(karf, function)
    names = {item.name for item in dataclasses.fields(COMMANDS[command])} - {"source"}
    assert names <= set(inspect.signature(found).parameters)
    assert all(f"{name}:" in found.__doc__ for name in names)


def test_texts_become_paths_and_lists_become_tuples():
    options = RenderOptions.of(project="a", edit=["b.json", Path("c.json")], overrides=["render.edges=field"])
    assert options.project == Path("a") and options.edit == (Path("b.json"), Path("c.json"))
    assert options.overrides == ("render.edges=field",)


def test_a_job_of_an_earlier_version_is_understood():
    values = {"views": "r_0", "edit": None, "out": None, "planes": True, "depth": False, "base": "photo", "threads": 2}
    options = options_of_job("render", Path("project"), values)
    assert (options.views, options.planes, options.base, options.out) == ("r_0", True, "photo", None)


def test_what_a_match_lacks_is_named_as_its_kind_has_it():
    assert "no picture" in refused(MatchOptions, project="a", out="b", view="r_0")
    assert "no target" in refused(MatchOptions, project="a", out="b", object="pot", source="#ff0000")


@pytest.mark.parametrize(("threads", "words"), [(0, "out of range"), (257, "1 to 256"), (True, "whole number")])
def test_threads_have_a_range(threads, words):
    assert words in refused(Options, threads=threads)


# -------------------------------------------------------------------------------------------------------- values and types
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
