"""Views are chosen by split, names and ranges of names."""

from pathlib import Path

import numpy as np
import pytest

from karf_engine.capture import choose_views
from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import Capture, View
from karf_engine.errors import DataError

NAMES = ("0000", "0001", "0002", "a-1", "a-2", "b")
CAMERA = Camera(4, 4, 4.0, 4.0, 2.0, 2.0, np.eye(4))
CAPTURE = Capture(Path(), "", tuple(View(name, name, CAMERA, None, "train") for name in NAMES))


@pytest.mark.parametrize(
    ("wanted", "names"),
    [
        ("0000-0002", ["0000", "0001", "0002"]),
        ("0002 - 0001", ["0001", "0002"]),
        ("a-1", ["a-1"]),  # a name
        ("a-1-b", ["a-1", "a-2", "b"]),
        ("0002-a-1", ["0002", "a-1"]),
        ("b, 0001, 0000-0001", ["b", "0001", "0000"]),  # each once
        ("all", list(NAMES)),
    ],
)
def test_names_and_ranges_are_chosen(wanted, names):
    views, is_captured = choose_views(CAPTURE, wanted)
    assert [view.name for view in views] == names and is_captured


@pytest.mark.parametrize("wanted", ["0000-0009", "c", "a-3", ""])
def test_unknown_names_are_refused(wanted):
    with pytest.raises(DataError, match="no view"):
        choose_views(CAPTURE, wanted)
