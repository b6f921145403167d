"""Files are written whole or not at all, also where another program holds them, and JSON is read in clear words."""

import os
import stat
from pathlib import Path

import pytest

from blender_tests.engine.reference.no_files import NO_FILES
from karf_engine.errors import DataError
from karf_engine.io import files
from karf_engine.io.files import atomic_write, read_json, write_json


def test_a_failed_write_leaves_the_old_file_and_no_other(tmp_path):
    path = tmp_path / "a.json"
    write_json(path, {"old": True})

    def fail(temporary):
        temporary.write_text("half")
        raise RuntimeError("no such color")

    with pytest.raises(RuntimeError):
        atomic_write(path, fail)
    with pytest.raises(ValueError):
        write_json(path, {"bad": float("nan")})
    assert read_json(path, "test") == {"old": True}
    assert [file.name for file in tmp_path.iterdir()] == ["a.json"]


@pytest.mark.parametrize("name", ["new/a.png", "n" * 251 + ".png"], ids=["in a new folder", "of the longest name"])
def test_a_written_file_keeps_its_suffix_on_the_way_and_has_the_usual_rights(tmp_path, name):
    path, seen = tmp_path / name, []

    def write(temporary):
        seen.append(temporary)
        temporary.write_text("x")

    atomic_write(path, write)
    (tmp_path / "plain").write_text("x")
    assert path.read_text() == "x"
    assert seen[0].suffix == ".png" and seen[0].parent.parent == path.parent and not seen[0].exists()
    assert stat.S_IMODE(path.stat().st_mode) == stat.S_IMODE((tmp_path / "plain").stat().st_mode)


def sparse(path):
    path.touch()
    os.truncate(path, 1 << 30)  # no disk is used


NO_JSON = [
    (lambda path: path.write_bytes(b'{"a": 1,\n "b": }'), r"a\.json \(test\) is broken JSON at line 2"),
    (lambda path: path.write_bytes(b"\xff\xfe\xfa"), "cannot be read"),
    (lambda path: None, "does not exist"),
    (sparse, "1,073,741,824 bytes; at most 33,554,432 are read"),
    *((make, "not a file") for make in NO_FILES),
]


@pytest.mark.parametrize(("make", "sentence"), NO_JSON)
def test_what_is_no_json_is_named_and_never_waited_for(tmp_path, make, sentence):
    make(tmp_path / "a.json")
    with pytest.raises(DataError, match=sentence):
        read_json(tmp_path / "a.json", "test")


def test_a_byte_order_mark_does_no_harm(tmp_path):
    (tmp_path / "a.json").write_bytes(b"\xef\xbb\xbf[1]")
    assert read_json(tmp_path / "a.json", "test") == [1]


HELD = [(3, number, True) for number in (5, 32, 33, 1224)]


@pytest.mark.parametrize(("times", "number", "is_replaced"), [*HELD, (10**9, 32, False), (1, None, False)])
def test_a_file_that_another_program_holds_on_windows_is_replaced_once_it_lets_go(
    monkeypatch, tmp_path, times, number, is_replaced
):
    (tmp_path / "state.json").write_text("earlier")
    errors = [PermissionError(13, "The process cannot access the file")] * min(times, 100)
    rename = Path.replace

    def replace(path, target):
        if errors:
            error = errors.pop() if times < 100 else errors[0]
            error.winerror = number
            raise error
        return rename(path, target)

    monkeypatch.setattr(Path, "replace", replace)
    monkeypatch.setattr(files.time, "sleep", lambda seconds: None)
    if is_replaced:
        write_json(tmp_path / "state.json", {"stage": 1})
    else:
        monkeypatch.setattr(files, "HELD_SECONDS", 0.0 if number else 100.0)
        with pytest.raises(PermissionError):
            write_json(tmp_path / "state.json", {})
    expected = '{\n "stage": 1\n}\n' if is_replaced else "earlier"
    assert [path.read_text() for path in tmp_path.iterdir()] == [expected]
