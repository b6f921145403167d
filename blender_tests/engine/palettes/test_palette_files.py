"""palette.json and edit.json: exact round trips, and sentences for everything that can be wrong in them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from karf_engine.errors import DataError
from karf_engine.io.files import read_json
from karf_engine.palettes.palette import (
    Edit,
    Palette,
    hex_to_rgb,
    read_edit,
    read_palettes,
    rgb_to_hex,
    write_edit,
    write_palettes,
)

POT = Palette("pot", np.array([[0, 0, 0], [0.1, 1 / 3, 0.7], [1, 0.25, 0.5]], np.float32))
MUG = Palette("mug", np.array([[0, 0, 0], [0.9, 0.8, 0.7]], np.float32))


def edit_file(folder: Path, **content: object) -> Path:
    path = folder / "edit.json"
    path.write_text(json.dumps({"schema": "karf-edit/1", **content}))
    return path


def test_hex_and_rgb_are_inverse_for_every_byte() -> None:
    for value in range(256):
        text = f"#{value:02x}{255 - value:02x}00"
        assert rgb_to_hex(hex_to_rgb(text)) == text
    np.testing.assert_array_equal(hex_to_rgb("FF0080"), np.array([255, 0, 128], np.float32) / np.float32(255))
    assert rgb_to_hex(np.array([-1, 0.5, 2])) == "#0080ff"


@pytest.mark.parametrize("text", ["#12345", "#gg0000", "red", ""])
def test_what_is_no_hex_color_is_refused(text: str) -> None:
    with pytest.raises(DataError, match="color"):
        hex_to_rgb(text)


def test_palettes_come_back_bit_by_bit(tmp_path: Path) -> None:
    path = tmp_path / "palette.json"
    write_palettes(path, [POT, MUG], shared=False, initial=[MUG, POT])
    read = read_palettes(path)
    assert [palette.name for palette in read] == ["pot", "mug"]
    for palette, expected in zip(read, [POT, MUG], strict=True):
        np.testing.assert_array_equal(palette.colors, expected.colors)
    content = read_json(path, "palettes")
    assert content["schema"] == "karf-palette/1" and content["shared"] is False
    assert content["objects"][0]["initial"] == [[0, 0, 0], [0.9, 0.8, 0.7]]


def test_edit_comes_back_bit_by_bit(tmp_path: Path) -> None:
    brighter_than_white = MUG.colors * np.float32(1.37)
    edit = Edit({"pot": POT.colors * np.float32(0.37), "mug": brighter_than_white}, "paper")
    write_edit(tmp_path / "e.json", edit)
    read = read_edit(tmp_path / "e.json", [POT, MUG])
    assert read.compositing == "paper"
    for name, colors in edit.colors.items():
        np.testing.assert_array_equal(read.colors[name], colors)


def test_null_and_missing_objects_stay_as_learned(tmp_path: Path) -> None:
    path = edit_file(tmp_path, objects={"pot": {"colors": ["#000000", None, "#ff0000"]}})
    read = read_edit(path, [POT, MUG])
    assert read.compositing == "delta"
    np.testing.assert_array_equal(read.colors["pot"], [[0, 0, 0], POT.colors[1], [1, 0, 0]])
    np.testing.assert_array_equal(read.colors["mug"], MUG.colors)
    # the learned palette itself is untouched
    assert POT.colors[2, 1] == 0.25


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"objects": {"jug": {"colors": ["#000000"]}}}, "unknown object 'jug'"),
        ({"objects": {"mug": {"colors": [None]}}}, "has 1 colors, its palette has 2"),
        ({"objects": {"mug": {"colors": [None, "#12"]}}}, "'#12' is not a color"),
        ({"objects": {"mug": {"colors": [None, [0, 0, 2.5]]}}}, "from 0 to 2"),
        ({"objects": {"mug": {"colors": [None, [0, 0]]}}}, "has the color"),
        ({"objects": {"mug": {"colors": [None, [True, 0, 0]]}}}, "has the color"),
        ({"objects": {"mug": {"colors": ["#010000", None]}}}, "changes entry 0"),
        ({"objects": {"mug": {}}}, "not a list"),
        ({"objects": []}, "not a table"),
        ({"compositing": "multiply", "objects": {}}, "multiply"),
        ({"schema": "karf-edit/9", "objects": {}}, "karf-edit/9"),
    ],
)
def test_wrong_edits_are_refused_by_name(tmp_path: Path, content: dict, words: str) -> None:
    path = edit_file(tmp_path, **content)
    with pytest.raises(DataError, match=words) as caught:
        read_edit(path, [POT, MUG])
    assert "edit.json" in caught.value.sentence and caught.value.hint


@pytest.mark.parametrize(
    "objects",
    [
        [{"name": "pot", "colors": [[0.1, 0, 0], [1, 1, 1]]}],
        [{"name": "", "colors": [[0, 0, 0]]}],
        [{"name": "a", "colors": [[0, 0, 0]]}, {"name": "a", "colors": [[0, 0, 0]]}],
        [{"name": "a", "colors": []}],
        [],
    ],
)
def test_wrong_palettes_are_refused(tmp_path: Path, objects: list) -> None:
    path = tmp_path / "palette.json"
    path.write_text(json.dumps({"schema": "karf-palette/1", "shared": False, "objects": objects}))
    with pytest.raises(DataError, match=r"palette\.json"):
        read_palettes(path)
