"""palette.json, edit.json and palette files of other programs: exact round trips and errors."""

import json
import struct

import numpy as np
import pytest

from karf_engine.errors import BadRequest, DataError
from karf_engine.export.finished_frames import frame_fingerprint
from karf_engine.io.files import read_json
from karf_engine.palettes.edge_shape import EdgeShape
from karf_engine.palettes.palette import (
    AddedColor,
    Edit,
    Palette,
    check_edit,
    edit_to_json,
    hex_to_rgb,
    read_edit,
    read_palettes,
    rgb_to_hex,
    write_edit,
    write_palettes,
)
from karf_engine.palettes.palette_files import read_edit_file, write_edit_file

POT = Palette("pot", np.array([[0, 0, 0], [0.1, 1 / 3, 0.7], [1, 0.25, 0.5]], np.float32))
MUG = Palette("my mug", np.array([[0, 0, 0], [0.9, 0.8, 0.7]], np.float32))
COLORS = {"pot": POT.colors, "my mug": MUG.colors}
EDIT = Edit(COLORS | {"pot": np.array([[0, 0, 0], [0.2, 0.4, 1 / 3], [0, 0, 1]], np.float32)})
ADDED = (AddedColor(np.float32([0.5, 0.2, 0.6]), 0.75), AddedColor(np.float32([0.8, 0.1, 1 / 3]), 0.5, 0.25))
WITH_ADDED = Edit(COLORS | {"pot": np.tile(POT.colors, (3, 1)) * np.float32(0.37)}, "paper", {"pot": ADDED})


def ase(*blocks, count=None):
    """The bytes of an Adobe swatch exchange file."""
    return b"ASEF\0\1\0\0" + struct.pack(">I", len(blocks) if count is None else count) + b"".join(blocks)


def color_block(name, model, *values):
    text = name.encode("utf-16-be") + b"\0\0"
    content = struct.pack(">H", len(text) // 2) + text + model + struct.pack(f">{len(values)}fH", *values, 2)
    return struct.pack(">HI", 1, len(content)) + content


def test_hex_and_rgb_are_inverse_for_every_byte():
    for value in range(256):
        text = f"#{value:02x}{255 - value:02x}00"
        assert rgb_to_hex(hex_to_rgb(text)) == text
    np.testing.assert_array_equal(hex_to_rgb("FF0080"), np.array([255, 0, 128], np.float32) / np.float32(255))
    assert rgb_to_hex(np.array([-1, 0.5, 2])) == "#0080ff"


def test_palettes_round_trip_bit_by_bit(tmp_path):
    path = tmp_path / "palette.json"
    write_palettes(path, [POT, MUG], shared=False, initial=[MUG, POT])
    read = read_palettes(path)
    assert [palette.name for palette in read] == ["pot", "my mug"]
    for palette, expected in zip(read, [POT, MUG], strict=True):
        np.testing.assert_array_equal(palette.colors, expected.colors)
    content = read_json(path, "palettes")
    assert content["schema"] == "karf-palette/1" and content["shared"] is False
    assert content["objects"][0]["initial"] == [[0, 0, 0], [0.9, 0.8, 0.7]]


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
def test_malformed_palettes_are_rejected(tmp_path, objects):
    path = tmp_path / "palette.json"
    path.write_text(json.dumps({"schema": "karf-palette/1", "shared": False, "objects": objects}))
    with pytest.raises(DataError, match=r"palette\.json"):
        read_palettes(path)


@pytest.mark.parametrize(
    "edit",
    [
        EDIT,
        Edit({"pot": POT.colors * np.float32(0.37), "my mug": MUG.colors * np.float32(1.37)}, "paper"),
        WITH_ADDED,
        Edit(COLORS, edges={"pot": EdgeShape(-1.5, 4), "my mug": EdgeShape(feather=0.25)}),
    ],
    ids=["colors", "brighter than white", "added colors", "edges"],
)
def test_edits_round_trip_bit_by_bit(tmp_path, edit):
    write_edit(tmp_path / "edit.json", edit)
    again = read_edit(tmp_path / "edit.json", [POT, MUG])
    assert (again.compositing, again.edges) == (edit.compositing, edit.edges)
    for name, colors in edit.colors.items():
        np.testing.assert_array_equal(again.colors[name], colors)
    for found, color in zip(again.added.get("pot", ()), edit.added.get("pot", ()), strict=True):
        np.testing.assert_array_equal(found.picked, color.picked)
        assert (found.reach, found.protect) == (color.reach, color.protect)


def test_absent_parts_of_an_edit_are_not_written():
    plain = edit_to_json(Edit(EDIT.colors, edges={"pot": EdgeShape()}))
    assert all(set(entry) == {"colors"} for entry in plain["objects"].values())
    added = edit_to_json(WITH_ADDED)["objects"]["pot"]["added"]
    assert ["protect" in each for each in added] == [False, True]


@pytest.fixture
def read_content(tmp_path):
    """Read an edit.json with the given content."""

    def read(**content):
        (tmp_path / "edit.json").write_text(json.dumps({"schema": "karf-edit/1", **content}))
        return read_edit(tmp_path / "edit.json", [POT, MUG])

    return read


def test_absent_colors_stay_as_learned(read_content):
    edit = read_content(objects={"pot": {"colors": ["#000000", None, "#ff0000"], "edges": {"feather": 3}}})
    assert edit.compositing == "delta" and edit.edges == {"pot": EdgeShape(0, 3)}
    np.testing.assert_array_equal(edit.colors["pot"], [[0, 0, 0], POT.colors[1], [1, 0, 0]])
    np.testing.assert_array_equal(edit.colors["my mug"], MUG.colors)
    assert POT.colors[2, 1] == 0.25  # the learned palette itself is untouched
    assert read_content(objects={"pot": {"colors": [None] * 3, "edges": {}}}).edges == {}


def with_added(**values):
    return {"colors": [None, None], "added": [{"picked": "#802020", "colors": ["#000000"] * 2} | values]}


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ({"colors": [None]}, "has 1 colors, its palette has 2"),
        *(({"colors": [None, text]}, f"'{text}' is not a color") for text in ("#12345", "#gg0000", "red", "")),
        ({"colors": [None, [0, 0, 2.5]]}, "from 0 to 2"),
        ({"colors": [None, [0, 0]]}, "has the color"),
        ({"colors": [None, [True, 0, 0]]}, "has the color"),
        ({"colors": ["#010000", None]}, "changes entry 0"),
        ({}, "not a list"),
        ({"colors": [None, None], "added": {}}, "is not a list"),
        ({"colors": [None, None], "added": ["#ff0000"]}, "has the added color '#ff0000'"),
        ({"colors": [None, None], "added": with_added()["added"] * 17}, "is not a list of 1 to 16"),
        (with_added(colors=["#000000"]), "of 1 colors, its palette has 2"),
        (with_added(colors=None), "is not a list"),
        (with_added(picked="red"), "is not a color"),
        (with_added(reach=0), "has the reach 0"),
        (with_added(reach=4.5), "has the reach 4.5"),
        *((with_added(protect=value), "protects") for value in (-0.1, 0.6, "0.2", None, True)),
        *(({"colors": [None, None], "edges": each}, "has the edges") for each in ([1, 2], 3, None)),
        *(({"colors": [None, None], "edges": {"choke": each}}, "has the choke") for each in (17, "2")),
        *(({"colors": [None, None], "edges": {"feather": each}}, "has the feather") for each in (-1, True)),
    ],
)
def test_malformed_edit_of_an_object_is_rejected_by_name(read_content, entry, words):
    with pytest.raises(DataError, match=words) as caught:
        read_content(objects={"my mug": entry})
    assert "edit.json: edit of 'my mug'" in caught.value.sentence and caught.value.hint


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"objects": {"jug": {"colors": ["#000000"]}}}, "edit.json edits the unknown object 'jug'"),
        ({"objects": []}, "edit.json: 'objects' is not a table"),
        ({"compositing": "multiply"}, "edit.json has compositing 'multiply'"),
        ({"schema": "karf-edit/9"}, "edit.json .* has schema 'karf-edit/9'"),
    ],
)
def test_malformed_edit_file_is_rejected_by_name(read_content, content, words):
    with pytest.raises(DataError, match=words):
        read_content(**content)


def test_edges_need_a_known_object_and_change_the_frame_fingerprint():
    with pytest.raises(BadRequest, match="lid"):
        check_edit(Edit(COLORS, edges={"lid": EdgeShape(1)}), [POT, MUG])
    shapes = [(0, 0), (1, 0), (2, 0), (0, 1)]
    marks = [frame_fingerprint("view", Edit(COLORS, edges={"pot": EdgeShape(*each)})) for each in shapes]
    assert marks[0] == frame_fingerprint("view", Edit(COLORS)) and len(set(marks)) == 4


@pytest.mark.parametrize("suffix, tolerance", [(".gpl", 0.5 / 255 + 1e-7), (".ase", 0), (".json", 0), (".JSON", 0)])
def test_edits_round_trip_through_palette_files(tmp_path, suffix, tolerance):
    write_edit_file(tmp_path / f"edit{suffix}", EDIT)
    again = read_edit_file(tmp_path / f"edit{suffix}", [POT, MUG])
    for name, colors in EDIT.colors.items():
        np.testing.assert_allclose(again.colors[name], colors, rtol=0, atol=tolerance)
    if suffix in (".gpl", ".ase"):
        with pytest.raises(BadRequest, match="cannot hold the colors that were added to pot"):
            write_edit_file(tmp_path / f"pots{suffix}", WITH_ADDED)


def test_palette_files_have_the_bytes_of_their_format(tmp_path):
    write_edit_file(tmp_path / "blue.gpl", EDIT)
    lines = ["GIMP Palette", "Name: blue", "#", " 51 102  85\tpot 1", "  0   0 255\tpot 2", "230 204 178\tmy mug 1"]
    assert (tmp_path / "blue.gpl").read_text().splitlines() == lines
    write_edit_file(tmp_path / "blue.ase", Edit({"ä": np.array([[0, 0, 0], [0.5, 1, 1.5]])}))
    group = struct.pack(">HIH", 0xC001, 6, 2) + "ä\0".encode("utf-16-be")
    color = color_block("ä 1", b"RGB ", 0.5, 1, 1)[:-1] + b"\0"
    assert (tmp_path / "blue.ase").read_bytes() == ase(group, color, struct.pack(">HI", 0xC002, 0))


def test_named_colors_go_to_their_swatches_and_others_stay(tmp_path):
    path = tmp_path / "some.gpl"
    path.write_text("GIMP Palette\nName: x\nColumns: 4\n# note\n\n0 0 255 my mug 1\n255 0 0\tpot 2\n")
    edit = read_edit_file(path, [POT, MUG], "paper")
    np.testing.assert_array_equal(edit.colors["my mug"][1], [0, 0, 1])
    np.testing.assert_array_equal(edit.colors["pot"], np.array([[0, 0, 0], POT.colors[1], [1, 0, 0]], np.float32))
    assert edit.compositing == "paper"


def test_unknown_names_go_by_order_and_lab_is_clipped_to_srgb(tmp_path):
    path, grey = tmp_path / "brand.ase", color_block("ink", b"Gray", 0.5)
    path.write_bytes(ase(color_block("red", b"RGB ", 1, 0, 0), grey, color_block("red", b"LAB ", 0.6, 90, -90)))
    edit = read_edit_file(path, [POT, MUG])
    np.testing.assert_array_equal(edit.colors["pot"], [[0, 0, 0], [1, 0, 0], [0.5, 0.5, 0.5]])
    red, green, blue = edit.colors["my mug"][1]
    assert 0 <= green < red <= 1 and 0 <= blue <= 1


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("1 2 3 red\n", "has 1 colors, none of which is named after a swatch; there are 3 swatches"),
        ("1 2 3 pot 1\n1 2 3 pot 9\n", "a color named 'pot 9'"),
        ("1 2 3 pot 1\n1 2 3 pot 1\n", "twice a color named 'pot 1'"),
        ("1 2 3 pot 0\n1 2 3 pot 1\n", "a color named 'pot 0'"),
        ("1 2 256 pot 1\n", "line 2 is not a color"),
        ("red pot 1\n", "line 2 is not a color"),
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
def test_damaged_or_unfitting_palette_files_are_rejected(tmp_path, lines, message):
    path = tmp_path / ("bad.gpl" if isinstance(lines, str) else "bad.ase")
    path.write_bytes(f"GIMP Palette\n{lines}".encode() if isinstance(lines, str) else lines)
    with pytest.raises(DataError, match=message):
        read_edit_file(path, [POT, MUG])


@pytest.mark.parametrize("name", ["none.gpl", "none.ase", "folder.gpl", "huge.ase"])
def test_missing_huge_and_folder_palette_files_are_rejected(tmp_path, name):
    (tmp_path / "folder.gpl").mkdir()
    with (tmp_path / "huge.ase").open("wb") as stream:
        stream.truncate(1 << 30)
    with pytest.raises(DataError, match=name):
        read_edit_file(tmp_path / name, [POT])
