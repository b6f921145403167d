"""Where a scene can be, as cameras, depth bounds and sparse points tell; and how finely photos look at it."""

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from blender_tests.engine.reference.still_life import camera_at, cameras
from karf_engine.capture.capture import SparsePoints, View
from karf_engine.fields.extent import (
    contraction_around_focus,
    pixels_per_voxel,
    psnr_without_detail,
    remove_detail,
    typical_pixels_per_voxel,
)
from karf_engine.fields.rendering.space import Box, Contraction
from karf_engine.project.settings import OpenSettings


def views_of(cameras):
    return [View(f"view{n}", f"view{n}", camera, None, "train") for n, camera in enumerate(cameras)]


def observed_by_all(positions, n_views):
    n = len(positions)
    return SparsePoints(
        positions,
        np.zeros((n, 3), np.uint8),
        np.zeros(n, np.float32),
        np.repeat(np.arange(n_views), n).astype(np.int32),
        np.tile(np.arange(n), n_views).astype(np.int32),
        np.zeros((n * n_views, 2), np.float32),
    )


def zoomed(camera, factor):
    return replace(camera, fx=factor * camera.fx, fy=factor * camera.fy)


def test_the_contraction_keeps_as_much_as_the_lens_sees():
    wide, tele = (contraction_around_focus([zoomed(c, f) for c in cameras(12)], OpenSettings()) for f in (1, 4))
    assert wide.radius == pytest.approx(4 * tele.radius)
    camera = cameras(12)[0]
    middle = np.zeros((1, 3))
    of_wide = pixels_per_voxel(wide, 0.02, middle, camera)
    of_tele = pixels_per_voxel(tele, 0.02, middle, zoomed(camera, 4))
    np.testing.assert_allclose(of_wide, of_tele, rtol=1e-4)


def test_a_voxel_spans_as_many_pixels_as_it_projects_to():
    camera = camera_at(0.0, 0.3)
    place = np.array([[0.2, -0.1, 0.1]])
    _, depth = camera.project(place)
    np.testing.assert_allclose(pixels_per_voxel(Box(), 0.1, place, camera), 0.1 * camera.fx / depth, rtol=1e-3)
    ball = Contraction(torch.zeros(3), 0.5, 1.0, 0.1)
    np.testing.assert_allclose(pixels_per_voxel(ball, 0.1, place, camera), 0.05 * camera.fx / depth, rtol=1e-3)
    assert np.isnan(pixels_per_voxel(Box(), 0.1, 2 * camera.position[None], camera)).all()


def test_the_typical_voxel_lies_where_photos_look():
    views = views_of(cameras(6))
    near = observed_by_all(np.array([[0.0, 0.0, 0.5]]), 6)
    none = observed_by_all(np.zeros((0, 3)), 6)
    at_focus = typical_pixels_per_voxel(Box(), 0.1, views, None)
    assert at_focus == pytest.approx(0.1 * views[0].camera.fx / 3.6, rel=1e-3)
    assert typical_pixels_per_voxel(Box(), 0.1, views, none) == at_focus
    assert typical_pixels_per_voxel(Box(), 0.1, views, near) > 1.05 * at_focus


def test_a_photo_loses_the_detail_that_is_smaller_than_a_voxel():
    stripes = np.zeros((64, 64, 3))
    stripes[:, ::2] = 1
    np.testing.assert_allclose(remove_detail(stripes, 2.0), 0.5)
    np.testing.assert_array_equal(remove_detail(stripes, 1.0), stripes)
    smooth = np.tile(np.linspace(0, 1, 64)[:, None, None], (1, 64, 3))
    fine, coarse = psnr_without_detail([stripes, smooth], 4.0)
    assert fine == pytest.approx(6.02, abs=0.1) and coarse > 40
