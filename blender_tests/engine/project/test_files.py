"""Atomic writes, JSON with readable errors, and file names that work on every system."""

import os
import stat
from pathlib import Path

import pytest

from blender_tests.engine.reference.no_files import NO_FILES
from karf_engine.capture.reader_utils import unique_names
from karf_engine.errors import DataError
from karf_engine.io import files
from karf_engine.io.files import atomic_write, read_json, write_json
from karf_engine.io.names import LONGEST, check_names, file_name, find_normalized, first_case_collision, is_file_name


def test_failed_write_keeps_the_old_file_only(tmp_path):
    path = tmp_path / "a.json"
    write_json(path, {"old": True})
    with pytest.raises(ZeroDivisionError):
        atomic_write(path, lambda temporary: (temporary.write_text("half"), 1 / 0))
    with pytest.raises(ValueError):
        write_json(path, {"bad": float("nan")})
    assert read_json(path, "test") == {"old": True}
    assert [file.name for file in tmp_path.iterdir()] == ["a.json"]


@pytest.mark.parametrize("name", ["new/a.png", "n" * 251 + ".png"], ids=["new folder", "longest name"])
def test_atomic_write_keeps_suffix_and_usual_permissions(tmp_path, name):
    path, seen = tmp_path / name, []
    atomic_write(path, lambda temporary: (seen.append(temporary), temporary.write_text("x")))
    (tmp_path / "plain").write_text("x")
    assert path.read_text() == "x"
    assert seen[0].suffix == ".png" and seen[0].parent.parent == path.parent and not seen[0].exists()
    assert stat.S_IMODE(path.stat().st_mode) == stat.S_IMODE((tmp_path / "plain").stat().st_mode)


BAD_JSON = [
    (lambda path: path.write_bytes(b'{"a": 1,\n "b": }'), r"a\.json \(test\) is broken JSON at line 2"),
    (lambda path: path.write_bytes(b"\xff\xfe\xfa"), "cannot be read"),
    (lambda path: None, "does not exist"),
    (lambda path: (path.touch(), os.truncate(path, 1 << 30)), "1,073,741,824 bytes; at most 33,554,432 are read"),
    *((make, "not a file") for make in NO_FILES),
]


@pytest.mark.parametrize(("make", "sentence"), BAD_JSON)
def test_malformed_json_is_rejected_without_blocking(tmp_path, make, sentence):
    make(tmp_path / "a.json")
    with pytest.raises(DataError, match=sentence):
        read_json(tmp_path / "a.json", "test")


def test_json_may_begin_with_a_byte_order_mark(tmp_path):
    (tmp_path / "a.json").write_bytes(b"\xef\xbb\xbf[1]")
    assert read_json(tmp_path / "a.json", "test") == [1]


HELD_THRICE = [(3, winerror, True) for winerror in (5, 32, 33, 1224)]


@pytest.mark.parametrize(("times", "winerror", "is_replaced"), [*HELD_THRICE, (100, 32, False), (1, None, False)])
def test_file_held_by_another_program_is_replaced_once_free(monkeypatch, tmp_path, times, winerror, is_replaced):
    (tmp_path / "state.json").write_text("earlier")
    failures, rename = [winerror] * times, Path.replace

    def replace(path, target):
        if failures:
            error = PermissionError(13, "The process cannot access the file")
            error.winerror = failures.pop()
            raise error
        return rename(path, target)

    monkeypatch.setattr(Path, "replace", replace)
    monkeypatch.setattr(files.time, "sleep", lambda seconds: None)
    if is_replaced:
        write_json(tmp_path / "state.json", {"stage": 1})
    else:
        monkeypatch.setattr(files, "HELD_SECONDS", 0.0 if winerror else 100.0)
        with pytest.raises(PermissionError):
            write_json(tmp_path / "state.json", {})
    expected = '{\n "stage": 1\n}\n' if is_replaced else "earlier"
    assert [path.read_text() for path in tmp_path.iterdir()] == [expected]


COMPOSED, DECOMPOSED = "caf\u00e9", "cafe\u0301"
ESCAPES = ["../x", "..", ".", "", "a/b", "a\\b", "/etc/x", "C:x", "a:b", "a\0b", "a\nb", "tab\there", "\udcff"]
DEVICES = ["con", "CON", "NUL.png", "aux.png", "Com1", "lpt9.tar.gz", "COM¹", "conin$", "CONOUT$", "prn .txt"]
DROPPED_BY_WINDOWS = ["pot.", "pot ", "pot. .", ".. ", "x" * 250, "x" * 300]
ORDINARY = [
    *("r_0", "IMG 0001 (2)", "mein Fóto 🏺", "a.b.c", ".hidden", "#1 + 2 = 3", "Töpfe 1", "壺"),
    *("console", "com10", "auxiliary.png", "null", "lpt"),
]


@pytest.mark.parametrize("name", [*ESCAPES, *DEVICES, *DROPPED_BY_WINDOWS])
def test_unsafe_file_names_are_replaced(name):
    made = file_name(name)
    assert not is_file_name(name)
    assert is_file_name(made) and file_name(made) == made and is_file_name(f"train_{made}_1000000")


@pytest.mark.parametrize("name", ORDINARY)
def test_ordinary_names_are_kept(name):
    assert is_file_name(name) and file_name(name) == name


def test_file_name_is_text_with_room_for_endings():
    assert not any(is_file_name(value) for value in (None, 5, []))
    assert is_file_name("n" * LONGEST) and not is_file_name("n" * (LONGEST + 1))
    assert LONGEST + len("-01234567.safetensors.tmp") < 255


def test_unicode_forms_of_a_name_are_equal():
    assert file_name(DECOMPOSED) == file_name(COMPOSED) == COMPOSED
    assert first_case_collision([COMPOSED, DECOMPOSED.upper()]) == (COMPOSED, DECOMPOSED.upper())
    assert find_normalized(DECOMPOSED, ["pot", COMPOSED]) == COMPOSED
    with pytest.raises(DataError, match="twice by one name"):
        check_names([COMPOSED, DECOMPOSED], Path("palette.json"), "an object")


@pytest.mark.parametrize(
    ("photos", "names"),
    [
        (["train AB", "train ab", "test Ab", "train A2"], ["train_AB", "train_ab_2", "test_Ab", "A2"]),
        ([f"train {COMPOSED}", f"train {DECOMPOSED}"], [f"train_{COMPOSED}", f"train_{DECOMPOSED}_2"]),
        (["train 1"] * 20_000, ["train_1", *(f"train_1_{number}" for number in range(2, 20_001))]),
    ],
    ids=["differing in case", "in two Unicode forms", "many of one name"],
)
def test_view_names_are_unique_on_every_disk(photos, names):
    assert unique_names([photo.split() for photo in photos]) == names
