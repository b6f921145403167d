"""The judge of edges: what it counts as border, as a thin part and as an error."""

from __future__ import annotations

import numpy as np
import pytest

from karf_engine.io.images import write_png
from tools.judging.edges import beside_thin_parts, border_band, mean_scores, score_edges
from tools.judging.truth import Truth

SIZE = 256  # thin is what is at most 8 pixels wide
ROWS, COLUMNS = np.indices((SIZE, SIZE)) + 0.5
DISK = np.hypot(ROWS - 100, COLUMNS - 128) < 40
WIRE = (np.abs(COLUMNS - 128) < 1.5) & (ROWS > 100) & (ROWS < 220)
GRAY, RED = np.full((SIZE, SIZE, 3), 0.5), np.broadcast_to([0.8, 0.2, 0.2], (SIZE, SIZE, 3))


def test_the_truth_scores_without_error():
    truth = (DISK | WIRE).astype(np.float32)
    score = score_edges(truth, truth, [RED], [RED])
    assert (score.iou, score.iou_thin, score.band_error, score.ciede2000, score.ciede2000_band) == (1, 1, 0, 0, 0)


def test_an_edge_that_is_two_pixels_off_costs_a_third_of_the_band():
    wide = np.hypot(ROWS - 100, COLUMNS - 128) < 42
    score = score_edges(wide.astype(np.float32), DISK.astype(np.float32), [RED], [RED])
    assert score.band_error == pytest.approx(1 / 3, abs=0.05)
    assert score.iou == pytest.approx(40**2 / 42**2, abs=0.01)


def test_errors_far_from_the_border_are_no_errors_of_the_band():
    hole = DISK & ~(np.hypot(ROWS - 100, COLUMNS - 128) < 20)
    assert score_edges(hole.astype(np.float32), DISK.astype(np.float32), [RED], [GRAY]).band_error == 0


def test_colors_are_judged_in_the_mask_and_in_the_band():
    rim_wrong = np.where(border_band(DISK)[..., None], GRAY, RED)
    score = score_edges(DISK.astype(np.float32), DISK.astype(np.float32), [rim_wrong], [RED])
    assert score.ciede2000_band > 20 and 0 < score.ciede2000 < score.ciede2000_band / 3


def test_a_wire_is_thin_and_a_disk_is_not():
    beside = beside_thin_parts(DISK | WIRE)
    assert beside[WIRE & (ROWS > 150)].all() and not beside[DISK].any()
    assert not beside_thin_parts(DISK).any()


def test_a_missing_wire_and_a_blob_round_it_cost_the_thin_parts():
    truth = (DISK | WIRE).astype(np.float32)
    blob = DISK | ((np.abs(COLUMNS - 128) < 5) & (ROWS > 100) & (ROWS < 220))
    assert score_edges(DISK.astype(np.float32), truth, [RED], [RED]).iou_thin == 0
    assert score_edges(blob.astype(np.float32), truth, [RED], [RED]).iou_thin < 0.5


def test_views_that_do_not_show_the_object_count_nothing():
    nothing = score_edges(np.zeros_like(GRAY[..., 0]), np.zeros_like(GRAY[..., 0]), [RED], [RED])
    seen = score_edges(DISK.astype(np.float32), DISK.astype(np.float32), [RED], [RED])
    means = mean_scores([nothing, seen])
    assert means["iou"] == 1 and "iou_thin" not in means


def test_labels_stand_for_the_coverage_where_a_capture_has_none(tmp_path):
    write_png(tmp_path / "labels" / "test" / "r_000.png", DISK)
    (tmp_path / "labels" / "names.json").write_text('{"disk": 255}')
    (tmp_path / "edits.json").write_text('{"edits": {}}')
    assert np.array_equal(Truth(tmp_path).coverage("disk")[0], DISK)
    write_png(tmp_path / "coverage" / "disk" / "test" / "r_000.png", DISK * 0.6)
    assert np.unique(Truth(tmp_path).coverage("disk")[0]) == pytest.approx([0, 0.6])
