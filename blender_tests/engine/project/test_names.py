"""Names that become files: the same on Windows, macOS and Linux, and none that leads out of its folder."""

from pathlib import Path

import pytest

from karf_engine.capture.reader_utils import unique_names
from karf_engine.errors import DataError
from karf_engine.io.names import LONGEST, check_names, file_name, find_normalized, first_case_collision, is_file_name

COMPOSED, DECOMPOSED = "caf\u00e9", "cafe\u0301"
LEADS_ELSEWHERE = ["../x", "..", ".", "", "a/b", "a\\b", "/etc/x", "C:x", "a:b", "a\0b", "a\nb", "tab\there", "\udcff"]
OF_DEVICES = ["con", "CON", "NUL.png", "aux.png", "Com1", "lpt9.tar.gz", "COM¹", "conin$", "CONOUT$", "prn .txt"]
DROPPED_BY_WINDOWS = ["pot.", "pot ", "pot. .", ".. ", "x" * 250, "x" * 300]
USUAL = [
    *("r_0", "IMG 0001 (2)", "mein Fóto 🏺", "a.b.c", ".hidden", "#1 + 2 = 3", "Töpfe 1", "壺"),
    *("console", "com10", "auxiliary.png", "null", "lpt"),
]


@pytest.mark.parametrize("name", [*LEADS_ELSEWHERE, *OF_DEVICES, *DROPPED_BY_WINDOWS])
def test_what_is_no_file_name_everywhere_is_made_one(name):
    made = file_name(name)
    assert not is_file_name(name)
    assert is_file_name(made) and file_name(made) == made and is_file_name(f"train_{made}_1000000")


@pytest.mark.parametrize("name", USUAL)
def test_usual_names_stay(name):
    assert is_file_name(name) and file_name(name) == name


def test_a_name_is_a_text_with_room_for_endings():
    assert not any(is_file_name(value) for value in (None, 5, []))
    assert is_file_name("n" * LONGEST) and not is_file_name("n" * (LONGEST + 1))
    assert LONGEST + len("-01234567.safetensors.tmp") < 255


def test_names_in_two_unicode_forms_are_one():
    assert file_name(DECOMPOSED) == file_name(COMPOSED) == COMPOSED
    assert first_case_collision([COMPOSED, DECOMPOSED.upper()]) == (COMPOSED, DECOMPOSED.upper())
    assert find_normalized(DECOMPOSED, ["pot", COMPOSED]) == COMPOSED
    with pytest.raises(DataError, match="twice by one name"):
        check_names([COMPOSED, DECOMPOSED], Path("palette.json"), "an object")


NUMBERED = ["train_0001", *(f"train_0001_{number}" for number in range(2, 20_001))]


@pytest.mark.parametrize(
    ("photos", "names"),
    [
        (
            ["train IMG_1", "train img_1", "test Img_1", "train IMG_2"],
            ["train_IMG_1", "train_img_1_2", "test_Img_1", "IMG_2"],
        ),
        ([f"train {COMPOSED}", f"train {DECOMPOSED}"], [f"train_{COMPOSED}", f"train_{DECOMPOSED}_2"]),
        (["train 0001"] * 20_000, NUMBERED),
    ],
    ids=["differing in case", "in two Unicode forms", "many of one name"],
)
def test_photos_become_views_that_any_disk_keeps_apart(photos, names):
    assert unique_names([photo.split() for photo in photos]) == names
