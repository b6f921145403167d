"""The window story's record, transcript and screenshots; the story itself needs a Blender window."""

import re
import struct
import subprocess
import sys

import numpy as np
import pytest

from blender_tests.engine.conftest import ROOT
from tools.window import record, screen

PASSED = record.Step("drag", "mouse", "The picture follows.", record.PASSED, 1.5, ["seven pictures"], ["drag"])
FAILED = record.Step("undo", "keys", "It is back.", record.FAILED, 1.0, ["the picture\nis another"])
NOT_RUN = record.Step("render", "keys", "It renders.")
LOG = "Read blend\nTraceback (most recent call last):\n  File 'a', line 1\n    x\nKeyError: 'pot'\nSaved\n"


def test_window_dump_is_read_as_pixels():
    height, width, padding = 5, 7, 3
    rows = np.random.default_rng(0).integers(0, 256, (height, width + padding, 4), np.uint8)
    line = 4 * (width + padding)
    header = [100 + 8, 7, 2, 24, width, height, 0, 0, 32, 1, 32, 32, line, 4, 0xFF0000, 0xFF00, 0xFF, 8, 256, 2]
    colors = bytes(2 * 12)
    dump = struct.pack(">25I", *header, width, height, 0, 0, 0) + b"screen\0\0" + colors + rows.tobytes()
    np.testing.assert_array_equal(screen.pixels_of(dump), rows[:, :width, 2::-1])


def test_record_survives_writing_and_reading(tmp_path):
    assert record.read(tmp_path / "record.json") == []
    for steps in ([PASSED], [PASSED, FAILED]):
        record.write(tmp_path / "record.json", steps)
        assert record.read(tmp_path / "record.json") == steps


def test_tracebacks_in_a_log_are_found():
    assert record.tracebacks("Saved\nError: no file\n") == []
    assert record.tracebacks(LOG * 2) == ["KeyError: 'pot'"] * 2
    assert record.tracebacks("Traceback (most recent call last):\n  File 'a'\n") == ["a traceback without an end"]


def test_running_engine_process_is_found(tmp_path):
    command = [sys.executable, "-c", "print(flush=True); input()", str(tmp_path / "project")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        process.stdout.readline()
        assert record.engine_processes(tmp_path) == [f"process {process.pid}: {' '.join(command)}"]
        process.stdin.write(b"\n")
    assert record.engine_processes(tmp_path) == []


@pytest.mark.parametrize("steps", [[PASSED], [PASSED, FAILED], [PASSED, NOT_RUN], []])
@pytest.mark.parametrize("findings", [[], ["a process is left"]])
def test_run_is_clean_if_all_passed_without_findings(steps, findings):
    is_clean = steps == [PASSED] and not findings
    assert record.is_clean(steps, findings) == is_clean
    assert ("every step holds" in record.transcript("Blender 5.2", steps, findings)) == is_clean


def test_transcript_lists_steps_and_findings():
    lines = record.transcript("Blender 5.2", [PASSED, FAILED], ["a process is left"]).splitlines()
    assert lines[0] == "# Blender 5.2: **not clean**"
    assert {
        "| drag | The picture follows. | mouse | passed | 1.5 |",
        "| undo | It is back. | keys | **failed** | 1.0 |",
        "- a process is left",
        "- seven pictures",
        "- ![drag](shots/drag.png)",
        "- the picture is another",
    } <= set(lines)


def test_story_clicks_existing_operators():
    folders = ("karf_blender/operators", "tools/window")
    operators, story = ("".join(file.read_text() for file in (ROOT / folder).glob("*.py")) for folder in folders)
    clicked = set(re.findall(r"[\"']karf\\\.(\w+)", story)) - {"objects"}
    assert len(clicked) >= 10 and clicked <= set(re.findall(r'bl_idname = "karf\.(\w+)"', operators))
