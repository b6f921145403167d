"""Every way to mattes that the judge compares finds a plain disk; the photo's edges are the nearest to its coverage."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from karf_engine.metrics.masks import iou
from karf_engine.recolor.matting.matte import dense_coverage
from tools.judging.matting_ways import WAYS, Evidence, larger_field

SIZE, FINE, COARSE = 128, 1280, 32


def disk() -> Evidence:
    """A red disk on gray, and a field that knows it at a quarter of the photo's size, half a pixel too large."""
    rows, columns = np.indices((FINE, FINE)) + 0.5
    distance = np.hypot(rows - FINE / 2, columns - FINE / 2)
    coverage = cv2.resize((distance < 400).astype(np.float32), (SIZE, SIZE), interpolation=cv2.INTER_AREA)
    rough = cv2.resize((distance < 420).astype(np.float32), (COARSE, COARSE), interpolation=cv2.INTER_AREA)
    noise = np.random.default_rng(0).normal(0, 2, (SIZE, SIZE, 3))
    photo = coverage[..., None] * [200, 30, 30] + (1 - coverage[..., None]) * [120, 130, 130] + noise
    pixels = np.rint(photo).clip(0, 255).astype(np.uint8)
    rendered = cv2.resize(pixels, (COARSE, COARSE), interpolation=cv2.INTER_AREA)
    return Evidence(pixels, rough[None], rendered, coverage[None], coverage[None])


def error(way, evidence: Evidence) -> float:
    """Mean absolute error of the coverage."""
    return float(np.abs(dense_coverage(way(evidence), (SIZE, SIZE)) - evidence.coverage).mean())


@pytest.mark.parametrize("way", [*WAYS.values(), larger_field], ids=lambda way: way.__name__)
def test_each_way_finds_the_disk(way):
    evidence = disk()
    found = dense_coverage(way(evidence), (SIZE, SIZE))
    assert iou(found[0] > 0.5, evidence.coverage[0] > 0.5) > 0.9


def test_the_photo_knows_more_than_the_field_and_the_truth_all():
    evidence = disk()
    assert error(WAYS["photo"], evidence) < error(WAYS["field"], evidence) / 2
    assert error(WAYS["truth"], evidence) < 1e-3


def test_the_bound_knows_the_object_s_own_color_in_mixed_pixels():
    evidence = disk()
    matte = WAYS["truth"](evidence)[0]
    assert len(matte.mixed) > 100
    assert np.abs(matte.mixed_colors.astype(int) - [200, 30, 30]).max() < 12
