"""The parts of matting, and the rough masks that guide a photo's mattes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import View
from karf_engine.recolor.matting.color_models import fit_color_models, posterior
from karf_engine.recolor.matting.mixed_pixels import closed_form_matting
from karf_engine.recolor.matting.thin_parts import Marks, read_marks, undistort_marks
from karf_engine.recolor.matting.tiles import tiles, upsample_tile
from karf_engine.segmentation.random_walk import neighbor_links, random_walk

CAMERA = Camera(24, 16, 20.0, 20.0, 12.0, 8.0, np.eye(4))
VIEW = View("left", "left", CAMERA, Path("left.jpg"), "train")
BENT = replace(CAMERA, distortion=(0.3, 0.0, 0.0, 0.0))


def test_matting_recovers_the_coverage_of_mixed_colors():
    random = np.random.default_rng(0)
    coverage = np.clip(np.linspace(-1, 2, 40), 0, 1)[None].repeat(12, 0).astype(np.float32)
    colors = coverage[..., None] * [0.7, 0.1, 0.1] + (1 - coverage[..., None]) * [0.1, 0.2, 0.5]
    colors += random.normal(0, 0.002, colors.shape)
    unknown = (coverage > 0) & (coverage < 1)
    unknown[[0, -1]] = False
    found = closed_form_matting(colors.astype(np.float32), np.where(unknown, 0.5, coverage), unknown)
    assert np.abs(found - coverage[unknown]).max() < 0.05


def test_random_walk_labels_sum_to_one_and_stop_at_edges():
    lab = np.zeros((20, 20, 3), np.float32)
    lab[:, 10:] = 50
    free = np.zeros((20, 20), bool)
    free[:, 2:18] = True
    priors = np.full((2, 20, 20), 0.5, np.float32)
    priors[:, :, :2] = [[[1]], [[0]]]
    priors[:, :, 18:] = [[[0]], [[1]]]
    labels = random_walk(neighbor_links(lab), priors, free, 1e-4)
    assert labels.sum(0) == pytest.approx(1, abs=0.01)
    assert labels[0].reshape(20, 16)[:, :8].min() > 0.9 > 0.1 > labels[0].reshape(20, 16)[:, 8:].max()


def test_shared_color_belongs_to_the_class_nearby():
    lab = np.zeros((60, 60, 3), np.float32)
    lab[:, 30:] = 60  # on the left class 0 has 0 and class 1 has 60; on the right it is the other way round
    lab[30:] = 60 - lab[30:]
    strengths = np.zeros((2, 60, 60))
    strengths[0, :, :30] = strengths[1, :, 30:] = 1
    models = fit_color_models(lab, strengths, np.random.default_rng(0))
    above, below = (posterior(models, np.zeros((1, 3)), np.array([[y, 0.2]]), np.ones((2, 1)))[0] for y in (0.1, 0.9))
    assert above > 0.7 > 0.3 > below


def test_tiles_cover_a_picture_once_and_upsample_as_one():
    counted = np.zeros((70, 50), int)
    planes = np.random.default_rng(0).random((2, 20, 15))
    whole = upsample_tile(planes, (70, 50), next(tiles((70, 50), side=100, margin=0)))
    pieces = np.zeros_like(whole)
    for tile in tiles((70, 50), side=32, margin=4):
        counted[tile.place] += 1
        pieces[(slice(None), *tile.place)] = upsample_tile(planes, (70, 50), tile)[(slice(None), *tile.inner)]
    assert (counted == 1).all()
    assert np.abs(pieces - whole).max() < 1e-3


def write_mask(path, mask):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray((mask * 255).astype(np.uint8)).save(path)


@pytest.fixture
def mask():
    drawn = np.zeros((16, 24), bool)
    drawn[2:9, 3:12] = True
    return drawn


def test_marks_are_read_for_each_object_of_a_photo(tmp_path, mask):
    assert read_marks(tmp_path / "no folder", ["pot"], VIEW) == Marks(None, (False,))
    write_mask(tmp_path / "mug" / "right.png", ~mask)
    assert read_marks(tmp_path, ["mug"], VIEW) == Marks(None, (False,))
    write_mask(tmp_path / "pot" / "left.png", mask)
    marks = read_marks(tmp_path, ["mug", "pot"], VIEW)
    assert not marks.drawn[0].any() and np.array_equal(marks.drawn[1], mask)
    (tmp_path / "pot" / "left.png").write_bytes(b"no picture")  # says nothing
    marks = read_marks(tmp_path, ["pot"], VIEW)
    assert not marks.drawn.any() and marks.thin == (False,)


def test_thin_part_is_found_in_a_mask_of_any_photo(tmp_path):
    blob = np.zeros((100, 200), bool)
    blob[20:60, 20:60] = True
    write_mask(tmp_path / "pot" / "left.png", blob)
    write_mask(tmp_path / "lamp" / "left.png", blob)
    assert read_marks(tmp_path, ["lamp", "pot"], VIEW).thin == (False, False)
    blob[40:42, 60:90] = True
    write_mask(tmp_path / "lamp" / "right.png", blob)
    assert read_marks(tmp_path, ["lamp", "pot"], VIEW).thin == (True, False)
    write_mask(tmp_path / "lamp" / "right.png", ~blob)  # drawn anew
    assert read_marks(tmp_path, ["lamp", "pot"], VIEW).thin == (False, False)


@pytest.mark.parametrize("camera, says", [(CAMERA, True), (BENT, False)])
def test_mask_of_the_working_size_needs_a_pinhole_camera(tmp_path, mask, camera, says):
    write_mask(tmp_path / "pot" / "left.png", mask[::2, ::2])
    assert read_marks(tmp_path, ["pot"], replace(VIEW, camera=camera)).drawn.any() == says


def test_marks_are_undistorted_for_a_pinhole_camera(mask):
    marks, unmarked = Marks(mask[None], (True,)), Marks(None, (True,))
    assert undistort_marks(unmarked, BENT) is unmarked and undistort_marks(marks, CAMERA) is marks
    straight = undistort_marks(marks, BENT)
    assert straight.thin == marks.thin and straight.drawn.shape == marks.drawn.shape and straight.drawn.dtype == bool
    assert straight.drawn.any() and not np.array_equal(straight.drawn, marks.drawn)
