"""A file that an earlier version has saved opens with everything that was done in it, and goes on as it did then."""

import json
import shutil

import numpy as np
import pytest

from .saved_files import DATA, TRIALS, everything_stored, tried

SAVED = sorted(folder.name for folder in DATA.glob("saved_by_*"))
FORGOTTEN = {"last", "given"}  # properties that no version needs any more
TOLERANCE = 1e-4  # of colors; numpy's versions round otherwise
# In 0.1.0 a linked swatch began a drag with the color of the other one, and merged ones depended on the drag's way; now
# each begins with its own color, and the last color alone counts.
OTHERWISE = {"linked swatch dragged": 0.01, "leader of a merged swatch dragged": 0.15}


@pytest.fixture
def saved(request, tmp_path):
    """The folder of a saved file, where it can be written."""
    return shutil.copytree(DATA / request.param, tmp_path / "saved")


@pytest.fixture
def expected(saved):
    return json.loads((saved / "expected.json").read_text())


def levels(text):
    """The channels of the colors of a text like "#rrggbb #rrggbb", 0 to 255."""
    return [float(each) for color in text.split() for each in bytes.fromhex(color.removeprefix("#"))]


def compare(found, wanted, place="", tolerance=TOLERANCE):
    """Everything that was told must be told still; numbers may be rounded otherwise, and there may be more."""
    if isinstance(wanted, dict):
        gone = wanted.keys() - found.keys() - FORGOTTEN
        assert not gone, f"{place}: {sorted(gone)} are gone"
        for name, value in ((name, value) for name, value in wanted.items() if name in found):
            compare(found[name], value, f"{place}.{name}", tolerance)
    elif isinstance(wanted, list):
        assert len(found) == len(wanted), place
        for number, value in enumerate(wanted):
            compare(found[number], value, f"{place}[{number}]", tolerance)
    elif isinstance(wanted, str) and wanted.startswith(
        "#"
    ):  # colors as #rrggbb, of numbers that may be rounded otherwise
        compare(levels(found), levels(wanted), place, tolerance=1.0)
    elif isinstance(wanted, float):
        assert found == pytest.approx(wanted, abs=tolerance), place
    else:
        assert found == wanted, place


@pytest.mark.parametrize("saved", SAVED, indirect=True)
def test_all_that_was_stored_is_there(bpy, addon, saved, expected):
    bpy.ops.wm.open_mainfile(filepath=str(saved / "scene.blend"))
    compare(everything_stored(bpy.context.scene.karf), expected["stored"])


@pytest.mark.parametrize("trial", TRIALS)
@pytest.mark.parametrize("saved", SAVED, indirect=True)
def test_it_shows_and_does_what_it_did(bpy, addon, saved, expected, trial, tmp_path):
    told, picture = tried(bpy, saved / "scene.blend", trial, tmp_path)
    tolerance = OTHERWISE.get(trial, TOLERANCE)
    compare(told, expected["trials"][trial], trial, tolerance)
    wanted = np.load(saved / "pictures.npz")[trial.replace(" ", "_")]
    assert np.abs(picture.astype(int) - wanted).max() <= max(1, 255 * tolerance)
