"""The command that renders the scene of a seed as a capture."""

import json
import subprocess
import sys
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
SEED = 240  # a scene of few photos


def make(bpy, out):
    """Run the command in its own process, which starts from Blender's factory settings."""
    if bpy.app.version >= (5, 0, 0):
        pytest.skip("captures are made with the Blender of requirements/, which has another compositor")
    command = [sys.executable, "-m", "tools.scenes", "--seed", str(SEED), "--size", "24", "--samples", "1"]
    subprocess.run([*command, "--out", str(out)], cwd=ROOT, check=True, capture_output=True)
    return out


@pytest.fixture(scope="module")
def capture(bpy, tmp_path_factory):
    return make(bpy, tmp_path_factory.mktemp("capture") / "drawn")


def read(path):
    return iio.imread(path).astype(int)[..., :3]


def test_photos_labels_recolors_and_masks_of_a_capture_agree(capture):
    names = json.loads((capture / "labels" / "names.json").read_text())
    edits = json.loads((capture / "edits.json").read_text())["edits"]
    for split, count in (("train", 14), ("test", 8)):
        frames = json.loads((capture / f"transforms_{split}.json").read_text())["frames"]
        for kind in (capture, capture / "labels"):
            assert len(list((kind / split).iterdir())) == len(frames) == count
    assert edits["first"]["objects"] == list(names)[:1] and edits["all"]["objects"] == list(names)
    view = f"{edits['first']['reference_view']}.png"
    labels = iio.imread(capture / "labels" / "train" / view, mode="P")
    assert labels.shape == (24, 24) and set(names.values()) <= set(np.unique(labels))
    change = np.abs(read(capture / "train" / view) - read(capture / "recolor" / "first" / "train" / view)).max(-1)
    assert np.median(change[labels == 1]) > 10 > np.median(change[labels != 1])
    for name in names:
        rough = capture / "coarse_masks"
        one, three = ({path.name for path in (rough / count / name).iterdir()} for count in ("one", "three"))
        assert one == {view} < three and len(three) == 3
        mask, truth = iio.imread(rough / "one" / name / view) > 0, labels == names[name]
        assert (mask & truth).sum() > 0.5 * (mask | truth).sum()


def test_same_seed_gives_the_same_files(bpy, capture, tmp_path):
    again = make(bpy, tmp_path / "again")
    for path in (*capture.glob("transforms_*.json"), *capture.glob("labels/*/*.png"), capture / "edits.json"):
        assert (again / path.relative_to(capture)).read_bytes() == path.read_bytes()
