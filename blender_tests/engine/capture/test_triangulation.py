"""Triangulating sparse points from photos with known cameras."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("pycolmap")

from blender_tests.engine.conftest import ROOT
from karf_engine.capture import open_capture
from karf_engine.capture.training_images import load_views
from karf_engine.capture.triangulation import neighbor_pairs, triangulate
from karf_engine.compute.progress import Progress
from karf_engine.errors import Cancelled


@pytest.fixture(scope="module")
def training_images():
    return load_views(open_capture(ROOT / "demo").split("train")[::2], 256)


def quiet(should_stop=lambda: False):
    return Progress(lambda *_, **__: None, should_stop, "points", 1)


def test_demo_points_lie_on_objects_and_reproject_accurately(training_images):
    points = triangulate(training_images, 1, quiet())
    assert len(points) > 60
    assert np.median(points.errors) < 1.5
    assert len(points.view) == len(points.point) == len(points.pixels) >= 2 * len(points)
    distances = []
    for number, training_image in enumerate(training_images):
        own = points.view == number
        pixels, depth = training_image.camera.project(points.positions[points.point[own]])
        assert (depth > 0).all()
        distances += np.linalg.norm(pixels - points.pixels[own], axis=1).tolist()
    assert np.median(distances) < 1.5
    # the table top is a disk of radius 2.2 at height 0, and objects on it are at most 1.5 high
    inside = (np.abs(points.positions[:, :2]).max(1) < 2.4) & (np.abs(points.positions[:, 2] - 0.6) < 1.1)
    assert inside.mean() > 0.95


def test_triangulation_can_be_cancelled(training_images):
    with pytest.raises(Cancelled):
        triangulate(training_images, 1, quiet(should_stop=lambda: True))


def test_unrelated_pictures_have_no_points(training_images):
    random = np.random.default_rng(0)
    noise = [replace(photo, color=random.random(photo.color.shape, np.float32)) for photo in training_images[:4]]
    assert len(triangulate(noise, 1, quiet())) <= 5


def test_cameras_are_paired_with_their_neighbors():
    cameras = [view.camera for view in open_capture(ROOT / "demo").split("train")]
    pairs = neighbor_pairs(cameras)
    assert all(a < b for a, b in pairs) and len(set(pairs)) == len(pairs)
    assert {number for pair in pairs for number in pair} == set(range(len(cameras)))
    assert len(cameras) * 5 <= len(pairs) <= len(cameras) * 10
    apart = [np.linalg.norm(cameras[a].position - cameras[b].position) for a, b in pairs]
    overall = [np.linalg.norm(a.position - b.position) for a in cameras for b in cameras]
    assert np.mean(apart) < 0.6 * np.mean(overall)
