"""What Windows reports becomes the same sentences as elsewhere; simulated, its numbers and messages are its manual's."""

from types import SimpleNamespace

import pytest

from karf_engine.io import failures
from karf_engine.io.failures import translate_error


@pytest.fixture
def on_windows(monkeypatch):
    monkeypatch.setattr(failures, "os", SimpleNamespace(name="nt"))


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        ("I/O error: There is not enough space on the disk. (os error 112)", "The disk is full"),
        ("I/O error: The process cannot access the file (os error 32)", "may not be read or written here"),
        ("I/O error: The filename or extension is too long. (os error 206)", "a name too long"),
        ("I/O error: The system cannot find the path specified. (os error 3)", "is not there"),
    ],
)
def test_numbers_in_messages_of_libraries_are_windows_own(on_windows, message, expected):
    assert expected in translate_error(RuntimeError(message)).sentence


@pytest.mark.parametrize("message", ["I/O error (os error 28)", "IoError(Os { code: 28, kind: StorageFull })"])
def test_elsewhere_they_are_those_of_c(message):
    assert "The disk is full" in translate_error(RuntimeError(message)).sentence


def test_a_path_that_is_too_long_is_not_called_missing(on_windows):
    path = "C:\\" + "very_long_folder\\" * 16 + "geometry.safetensors"
    assert "a name too long" in translate_error(FileNotFoundError(2, "No such file", path)).sentence
    assert "is not there" in translate_error(FileNotFoundError(2, "No such file", "C:\\a.png")).sentence
