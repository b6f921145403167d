"""The window story's record, transcript and screenshots; the story itself needs a Blender window (docs/window_story.md)."""

import json
import re
import struct
from pathlib import Path

import numpy as np
import pytest

from karf_engine.io.images import read_mask
from tools.window import capture, record, screen

ROOT = Path(__file__).resolve().parents[3]
WINDOW = ROOT / "tools" / "window"


def dumped(pixels, order, padding=0):
    """A window dump as Xvfb writes it: header, color table, rows of 32 bits a pixel."""
    height, width = pixels.shape[:2]
    line = 4 * (width + padding)
    header = [
        100 + 8,
        7,
        2,
        24,
        width,
        height,
        0,
        order == ">",
        32,
        1,
        32,
        32,
        line,
        4,
        0xFF0000,
        0xFF00,
        0xFF,
        8,
        256,
        2,
    ]
    header += [width, height, 0, 0, 0]
    rows = np.zeros((height, width + padding), f"{order}u4")
    rows[:, :width] = pixels.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)
    return struct.pack(">25I", *header) + b"screen\0\0" + bytes(2 * 12) + rows.tobytes()


@pytest.mark.parametrize("order", ["<", ">"])
def test_a_window_dump_becomes_the_pixels_of_the_screen(order):
    pixels = np.random.default_rng(0).integers(0, 256, (5, 7, 3), np.uint8)
    np.testing.assert_array_equal(screen.read_dump(dumped(pixels, order, padding=3)), pixels)


def test_other_and_cut_dumps_are_refused():
    whole = dumped(np.zeros((2, 2, 3), np.uint8), "<")
    for damaged in (b"", whole[:60], whole[:-1], struct.pack(">25I", *[6] * 25) + whole[100:]):
        with pytest.raises(ValueError, match="window dump"):
            screen.read_dump(damaged)


def test_a_step_that_never_ends_is_the_one_that_crashed(tmp_path):
    file = tmp_path / "record.jsonl"
    record.note(file, kind="begin", name="drag", how="mouse")
    record.note(file, kind="note", text="seven pictures")
    record.note(file, kind="shot", text="dragged")
    record.note(file, kind="end", outcome=record.PASSED, seconds=1.5)
    record.note(file, kind="begin", name="render", how="keys")
    drag, render = record.steps_of(file.read_text().splitlines())
    assert drag == record.Step("drag", "mouse", record.PASSED, 1.5, ("seven pictures",), ("dragged",))
    assert (render.name, render.outcome) == ("render", record.CRASHED)
    # the next Blender goes on behind it
    record.note(file, kind="begin", name="save", how="keys")
    record.note(file, kind="end", outcome=record.FAILED, seconds=2.0)
    outcomes = [step.outcome for step in record.steps_of(file.read_text().splitlines())]
    assert outcomes == [record.PASSED, record.CRASHED, record.FAILED]


def test_every_traceback_in_a_log_is_found_by_what_it_says():
    log = "Read blend\nTraceback (most recent call last):\n  File 'a', line 1\n    x\nKeyError: 'pot'\nSaved\n"
    assert record.tracebacks("Saved\nError: no file\n") == []
    assert record.tracebacks(log * 2) == ["KeyError: 'pot'"] * 2
    assert record.tracebacks("Traceback (most recent call last):\n  File 'a'\n") == ["a traceback without an end"]


def test_a_transcript_is_clean_only_where_all_passed_and_nothing_was_found(tmp_path):
    passed = record.Step("drag", "mouse", record.PASSED, 1.0, shots=("dragged",))
    failed = record.Step("undo", "keys", record.FAILED, 1.0, ("the picture\nis another",))
    for steps, findings, is_clean in (
        ((passed,), (), True),
        ((passed, failed), (), False),
        ((passed,), ("a process is left",), False),
        ((), (), False),
    ):
        assert record.Transcript("Blender 5.2", 3.0, steps, findings).is_clean == is_clean
    record.write_transcript(tmp_path, record.Transcript("Blender 5.2", 3.0, (passed, failed), ("a process is left",)))
    page = (tmp_path / "transcript.md").read_text()
    for line in ("| undo | keys | **failed** | 1.0 |", "- a process is left", "- the picture is another"):
        assert line in page.splitlines()
    assert "shots/dragged.png" in page
    assert json.loads((tmp_path / "transcript.json").read_text())["steps"][1]["outcome"] == "failed"


def test_the_story_clicks_buttons_that_exist():
    text = _sources("tools/window")
    operators = set(re.findall(r'bl_idname = "karf\.(\w+)"', _sources("karf_blender/operators")))
    clicked = set(re.findall(r'"karf\\\.(\w+)', text)) - {
        "card",
        "marking",
        "objects",
        "captured_size",
        "photo_space",
        "preset",
    }
    assert clicked and clicked <= operators
    assert len(re.findall(r"^@CHAPTER\.step\(", text, re.MULTILINE)) >= 20


def _sources(folder):
    return "\n".join(file.read_text() for file in (ROOT / folder).glob("*.py"))


def test_the_box_lies_around_the_object_in_the_first_view_that_shows_it_well(tmp_path):
    seen = capture.look(capture.DEMO, capture.write_demo_truth(tmp_path / "pot"))
    assert (seen.views, seen.view) == (72, "train_r_001")
    (left, top), (right, bottom) = seen.box
    rows, columns = np.nonzero(read_mask(tmp_path / "pot" / "train_r_001.png"))
    assert left < columns.min() / 256 < columns.max() / 256 < right
    assert bottom < 1 - rows.max() / 256 < 1 - rows.min() / 256 < top
