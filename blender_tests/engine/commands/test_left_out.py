"""Photos that are left out of learning: by name, or because they cannot be decoded."""

from types import SimpleNamespace

import numpy as np
import pytest

from blender_tests.engine.reference.capture_files import put, random_rig, write_colmap
from karf_engine.capture import open_capture
from karf_engine.capture.capture import leave_out, without_views
from karf_engine.commands.geometry import load_photos
from karf_engine.errors import DataError

NAMES = [f"{number}.png" for number in range(6)]


@pytest.fixture
def capture(tmp_path):
    write_colmap(tmp_path, random_rig(5, 6), NAMES)
    return open_capture(tmp_path, holdout=3)


def test_left_out_photos_are_neither_learned_nor_tested(capture):
    found = leave_out(capture, ["0", "1"])
    assert [view.split for view in found.views] == ["val", "val", "train", "test", "train", "train"]
    with pytest.raises(DataError, match="has no view 'nothing'"):
        leave_out(capture, ["nothing"])


def test_removed_views_lose_their_observations(capture):
    found = without_views(capture, ["1", "4"])
    assert [view.name for view in found.views] == ["0", "2", "3", "5"]
    for new, old in enumerate((0, 2, 3, 5)):
        own, theirs = found.points.view == new, capture.points.view == old
        np.testing.assert_array_equal(found.points.pixels[own], capture.points.pixels[theirs])
        np.testing.assert_array_equal(found.points.point[own], capture.points.point[theirs])


@pytest.mark.parametrize("damaged", [["1.png"], ["0.png"], ["1.png", "3.png"]])
def test_damaged_photos_are_left_out_with_a_warning(capture, damaged):
    for name in damaged:  # photos 0 and 3 are held out
        path = capture.view(name[0]).image
        put(path, path.read_bytes()[:40])
    events = []
    job = SimpleNamespace(
        settings=SimpleNamespace(geometry=SimpleNamespace(long_side=8)),
        emit=lambda kind, **values: events.append((kind, values["sentence"])),
    )
    found, images = load_photos(job, capture)
    kept = [name[0] for name in NAMES if name not in damaged]
    assert [view.name for view in found.views] == kept
    assert [image.view.name for image in images] == [name for name in kept if name not in ("0", "3")]
    ((kind, sentence),) = events
    assert kind == "warning" and sentence.startswith(f"{len(damaged)} of 6 photos were left out: ")


def test_capture_without_readable_photos_is_rejected(capture):
    for view in capture.views:
        put(view.image, view.image.read_bytes()[:40])
    job = SimpleNamespace(settings=SimpleNamespace(geometry=SimpleNamespace(long_side=8)))
    with pytest.raises(DataError, match="cannot be read as a picture"):
        load_photos(job, capture)
