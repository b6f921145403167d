"""Names that become files: the same on Windows, macOS and Linux, and no two that one of them takes for one."""

from pathlib import Path

import pytest

from karf_engine.capture.reader_utils import unique_names
from karf_engine.errors import DataError
from karf_engine.io.names import check_names, file_name, find_normalized, first_case_collision, is_file_name

RESERVED = ["CON", "nul", "aux.png", "Com1", "lpt9.tar.gz", "COM¹", "conin$", "CONOUT$", "prn .txt"]


@pytest.mark.parametrize("name", RESERVED)
def test_what_windows_keeps_for_devices_is_no_name(name):
    assert not is_file_name(name)
    assert is_file_name(file_name(name))


@pytest.mark.parametrize("name", ["console", "com10", "auxiliary.png", "null", "lpt", "Töpfe 1", "壺"])
def test_names_that_only_look_like_these_stay(name):
    assert is_file_name(name) and file_name(name) == name


@pytest.mark.parametrize("name", ["pot.", "pot ", "pot. .", "a:b", "a\\b", "tab\there", "", "x" * 250])
def test_what_windows_drops_or_refuses_is_changed(name):
    assert not is_file_name(name)
    assert is_file_name(file_name(name))


def test_letters_with_accents_are_the_same_however_a_system_writes_them():
    composed, decomposed = "caf\u00e9", "cafe\u0301"
    assert file_name(decomposed) == file_name(composed) == composed


def test_names_in_two_unicode_forms_are_one():
    composed, decomposed = "caf\u00e9", "CAFE\u0301"
    assert first_case_collision([composed, decomposed]) == (composed, decomposed)
    assert find_normalized(decomposed.lower(), ["pot", composed]) == composed
    with pytest.raises(DataError, match="twice by one name"):
        check_names([composed, decomposed.lower()], Path("palette.json"), "an object")
    names = unique_names([("train", composed), ("train", decomposed)])
    assert first_case_collision(names) is None


def test_photos_whose_names_differ_by_case_alone_become_views_that_any_disk_keeps_apart():
    names = unique_names([("train", "IMG_1"), ("train", "img_1"), ("test", "Img_1"), ("train", "IMG_2")])
    assert len({name.casefold() for name in names}) == 4
    assert names[-1] == "IMG_2"
