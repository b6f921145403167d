"""Files saved by earlier versions open with all their edits and behave as before."""

import json
import shutil

import numpy as np
import pytest

from .saved_files import DATA, TRIALS, everything_stored, run_trial

SAVED = sorted(folder.name for folder in DATA.glob("saved_by_*"))
FORGOTTEN = {"last", "given", "rule"}  # properties that no version needs any more
TOLERANCE = 1e-4  # of colors, which numpy versions round differently
# In 0.1.0 a linked swatch started a drag from the other's color, and merged ones depended on the path of the drag; now
# each starts from its own color, and only the last color counts. The set of an added color was fitted by squares of sRGB.
# Swatches that follow a dragged one, also by keyframes, compensated for its distance from the best fit.
CHANGED = {  # largest difference of colors, and of the picture in 8-bit levels
    "frame 1": (0.003, 1),
    "frame 11": (0.003, 1),
    "split": (0.01, 2),
    "linked swatch dragged": (0.1, 5),
    "leader of a merged swatch dragged": (0.15, 26),
    "added color dragged": (0.01, 2),
}


@pytest.fixture
def saved(request, tmp_path):
    """A writable copy of a saved file's folder."""
    return shutil.copytree(DATA / request.param, tmp_path / "saved")


def channels(text):
    """The channels of a text like "#rrggbb #rrggbb", 0 to 255."""
    return [float(each) for color in text.split() for each in bytes.fromhex(color.removeprefix("#"))]


def compare(found, expected, place="", tolerance=TOLERANCE):
    """Assert that all expected values are found, up to rounding; more may be there."""
    if isinstance(expected, dict):
        gone = expected.keys() - found.keys() - FORGOTTEN
        assert not gone, f"{place}: {sorted(gone)} are gone"
        for name in expected.keys() & found.keys():
            compare(found[name], expected[name], f"{place}.{name}", tolerance)
    elif isinstance(expected, list):
        assert len(found) == len(expected), place
        for number, value in enumerate(expected):
            compare(found[number], value, f"{place}[{number}]", tolerance)
    elif isinstance(expected, str) and expected.startswith("#"):
        compare(channels(found), channels(expected), place, tolerance=1.0)
    elif isinstance(expected, float):
        assert found == pytest.approx(expected, abs=tolerance), place
    else:
        assert found == expected, place


def assert_trial(bpy, saved, trial, folder):
    """Run a trial on a saved file and compare the values and the picture with what the file's version gave."""
    values, picture = run_trial(bpy, saved / "scene.blend", trial, folder)
    tolerance, levels = CHANGED.get(trial, (TOLERANCE, 1))
    compare(values, json.loads((saved / "expected.json").read_text())["trials"][trial], trial, tolerance)
    expected = np.load(saved / "pictures.npz")[trial.replace(" ", "_")]
    assert np.abs(picture.astype(int) - expected).max() <= levels


@pytest.mark.parametrize("saved", SAVED, indirect=True)
def test_stored_properties_are_kept(bpy, addon, saved):
    bpy.ops.wm.open_mainfile(filepath=str(saved / "scene.blend"))
    compare(everything_stored(bpy.context.scene.karf), json.loads((saved / "expected.json").read_text())["stored"])


@pytest.mark.parametrize("trial", TRIALS)
@pytest.mark.parametrize("saved", SAVED, indirect=True)
def test_edits_give_the_same_colors_and_picture(bpy, addon, saved, trial, tmp_path):
    assert_trial(bpy, saved, trial, tmp_path)
