"""The comparison with OpenSplat: what is given to it and read from it, with a small program in its place."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("skimage")

from blender_tests.engine.reference.still_life import BALL_CENTER
from karf_engine.capture import open_capture
from karf_engine.capture.capture import SparsePoints
from karf_engine.capture.training_images import load_views
from tools.speed import peer

STAND_IN = """
import argparse, json, pathlib
parser = argparse.ArgumentParser()
parser.add_argument("input", type=pathlib.Path)
for name in ("-n", "-s", "--num-downscales", "--refine-every"):
    parser.add_argument(name, type=int)
for name in ("-o", "--resume"):
    parser.add_argument(name, type=pathlib.Path)
for name in ("--cpu", "--keep-crs", "--val"):
    parser.add_argument(name, action="store_true", required=name != "--val")
parser.add_argument("--val-image")
options = parser.parse_args()
names = [frame["file_path"] for frame in json.loads((options.input / "transforms.json").read_text())["frames"]]
if options.resume:
    assert int(options.resume.read_text()) == options.n and f"images/{options.val_image}" in names
    print(f"/a b/{options.val_image} validation loss: 0.1")
    print(f"/a b/{options.val_image} validation PSNR: {20 + options.n / 100 + int(options.val_image[:5])}")
else:
    print("Using CPU")
    for step in range(1, options.n + 1):
        sum(range(20000))
        print(f"Step {step}: 0.25 [{100 * step // options.n}%]")
        if step % options.s == 0:
            options.o.with_name(f"{options.o.stem}_{step}.ply").write_text(str(step))
"""


@pytest.fixture
def training_images(still_life):
    capture = open_capture(still_life.capture)
    return {split: load_views(capture.split(split), 32) for split in ("train", "test")}


def points_at(*positions):
    n, nothing = len(positions), np.zeros(0, np.int32)
    colors = np.full((n, 3), 128, np.uint8)
    return SparsePoints(np.array(positions), colors, np.zeros(n, np.float32), nothing, nothing, np.zeros((0, 2)))


def test_it_gets_the_photos_cameras_and_points_that_we_learn_from(training_images, tmp_path):
    peer.write_folder(tmp_path, training_images["train"], points_at(BALL_CENTER, (0.25, -1e-7, 3)))
    written = json.loads((tmp_path / "transforms.json").read_text())
    assert written["camera_model"] and len(written["frames"]) == len(training_images["train"])
    frame, training_image = written["frames"][0], training_images["train"][0]
    assert (tmp_path / frame["file_path"]).is_file() and (frame["w"], frame["h"]) == (32, 32)
    assert frame["fl_x"] == training_image.camera.fx and np.array_equal(
        frame["transform_matrix"], training_image.camera.camera_to_world
    )
    header, _, rows = (tmp_path / written["ply_file_path"]).read_text().partition("end_header\n")
    assert "element vertex 2" in header and rows == "-0.4 0 0.1 128 128 128\n0.25 -1e-07 3 128 128 128\n"
    found = {view.name: view.camera for view in open_capture(tmp_path).views}  # our own reader takes it too
    assert len(found) == len(training_images["train"])


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="seconds are counted on Linux alone")
def test_every_held_out_photo_is_judged_at_every_step_that_is_looked_at(training_images, tmp_path):
    (tmp_path / "opensplat.py").write_text(STAND_IN)
    program, extra = [sys.executable, str(tmp_path / "opensplat.py")], ["--refine-every", "100"]
    peer.write_folder(tmp_path / "learn", training_images["train"], points_at(BALL_CENTER))
    peer.write_folder(tmp_path / "judge", training_images["test"] + training_images["train"], points_at(BALL_CENTER))
    saved = peer.learn_theirs(program, tmp_path, 400, 200, 1, extra)
    assert [step for step, _ in saved] == [200, 400] and 0 < saved[0][1] <= saved[1][1]
    values = [peer.judge(program, tmp_path, 400, number, extra) for number in range(2)]
    assert values == [24, 25]
    assert str(peer.Point("OpenSplat", 12.0, values)).split() == "OpenSplat 12 s mean 24.50 dB worst 24.00 dB".split()


def test_a_version_that_prints_no_psnr_is_named(tmp_path):
    with pytest.raises(SystemExit, match="prints no validation PSNR"):
        peer.judge([sys.executable, "-c", "print('validation loss: 0.1')"], tmp_path, 10, 0, [])
