"""Files are written whole or not at all, also where another program holds them, and JSON is read in clear words."""

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
    assert len({stat.S_IMODE(file.stat().st_mode) for file in (path, tmp_path / "plain")}) == 1


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b'{"a": 1,\n "b": }', r"a\.json \(test\) is broken JSON at line 2"),
        (None, "does not exist"),
        (b"\xff\xfe\xfa", "cannot be read"),
    ],
)
def test_what_is_no_json_is_named(tmp_path, content, sentence):
    if content is not None:
        (tmp_path / "a.json").write_bytes(content)
    with pytest.raises(DataError, match=sentence):
        read_json(tmp_path / "a.json", "test")


@pytest.mark.parametrize("make", NO_FILES)
def test_what_lies_in_place_of_a_json_file_is_never_waited_for(tmp_path, make):
    make(tmp_path / "a.json")
    with pytest.raises(DataError, match="not a file"):
        read_json(tmp_path / "a.json", "test")


def test_json_without_end_is_refused_by_its_size(tmp_path):
    with (tmp_path / "a.json").open("wb") as file:
        file.truncate(1 << 30)  # no disk is used
    with pytest.raises(DataError, match="1,073,741,824 bytes; at most 33,554,432 are read"):
        read_json(tmp_path / "a.json", "test")


def test_a_byte_order_mark_does_no_harm(tmp_path):
    (tmp_path / "a.json").write_bytes(b"\xef\xbb\xbf[1]")
    assert read_json(tmp_path / "a.json", "test") == [1]


# ---------------------------------------------------------------------------------------- held by another program (Windows)
@pytest.fixture
def held(monkeypatch):
    """The first `times` renames fail as Windows fails them, with `winerror`."""
    state = {"times": 0, "winerror": 32}
    rename = Path.replace

    def replace(path, target):
        if state["times"] > 0:
            state["times"] -= 1
            error = PermissionError(13, "The process cannot access the file", str(target))
            error.winerror = state["winerror"]
            raise error
        return rename(path, target)

    monkeypatch.setattr(Path, "replace", replace)
    monkeypatch.setattr(files.time, "sleep", lambda seconds: None)
    return state


@pytest.mark.parametrize("winerror", [5, 32, 33, 1224])
def test_a_file_that_is_held_for_a_moment_is_replaced_all_the_same(held, winerror, tmp_path):
    held.update(times=3, winerror=winerror)
    write_json(tmp_path / "state.json", {"stage": 1})
    assert (tmp_path / "state.json").read_bytes() == b'{\n "stage": 1\n}\n'
    assert [path.name for path in tmp_path.iterdir()] == ["state.json"]


@pytest.mark.parametrize(("times", "winerror"), [(10**9, 32), (1, None)], ids=["held for good", "may not be written"])
def test_a_file_that_cannot_be_replaced_stays_and_says_so(held, monkeypatch, tmp_path, times, winerror):
    (tmp_path / "state.json").write_text("earlier")
    held.update(times=times, winerror=winerror)
    monkeypatch.setattr(files, "HELD_SECONDS", 0.0 if winerror else 100.0)
    with pytest.raises(PermissionError):
        write_json(tmp_path / "state.json", {})
    assert [path.read_text() for path in tmp_path.iterdir()] == ["earlier"]
