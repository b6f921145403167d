"""Details of marked objects: the Gaussians that learn them, crops around objects, and the sharpness reached."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.ndimage import gaussian_filter

pytest.importorskip("numba")

from blender_tests.engine.splats.clouds import BACKGROUND, NEAR, camera_ahead, cloud
from karf_engine.compute.progress import Progress
from karf_engine.io.color import to_bytes
from karf_engine.splats.details import DetailFit, Quality, iterations_of, place_of, refined
from karf_engine.splats.fit import Photo, psnr
from karf_engine.splats.gaussians import Gaussians
from karf_engine.splats.kernels.arrays import COLOR, LOG_SCALE, LOGIT
from karf_engine.splats.rasterizer import rasterize
from karf_engine.splats.sharpness import blur_of, word_for

TRUTH = Gaussians(cloud(60, 1, seed=7), 0, BACKGROUND, NEAR)
CAMERA = camera_ahead()
PHOTO = Photo(CAMERA, to_bytes(rasterize(TRUTH, CAMERA).image[..., :3].clip(0, 1)), None, None)
INSIDE = np.arange(len(TRUTH)) < 50
CROP = PHOTO.cropped(slice(4, 34), slice(2, 38))


def blurred_draft():
    """The truth with every Gaussian too large."""
    table = TRUTH.table.copy()
    table[:, LOG_SCALE : LOG_SCALE + 3] += 0.5
    return replace(TRUTH, table=table)


def quiet():
    return Progress(lambda *_, **__: None, lambda: False, "splats", 100)


def learned(start, n_fine, iterations=60):
    fit = DetailFit(start, n_fine, [CROP], iterations, seed=0)
    fit.run(quiet())
    return fit.gaussians


def test_details_show_a_crop_better_than_their_draft():
    draft = blurred_draft()
    start, n_fine = refined(draft, INSIDE, [CROP], 40, seed=0)
    assert len(start) == len(draft) + 40 and n_fine > 40
    assert psnr(learned(start, n_fine), [CROP]) > psnr(draft, [CROP]) + 3


def test_what_is_outside_the_boxes_keeps_its_shape():
    draft = blurred_draft()
    start, n_fine = refined(draft, INSIDE, [CROP], 40, seed=0)
    assert n_fine == INSIDE.sum() + 40
    outside, before = learned(start, n_fine).table[n_fine:], draft.table[~INSIDE]
    constant = slice(COLOR, COLOR + 3)
    assert_array_equal(np.delete(outside, np.r_[constant], 1), np.delete(before, np.r_[constant], 1))
    assert (outside[:, constant] != before[:, constant]).any()


def test_transparent_gaussians_move_to_errors():
    start, n_fine = refined(blurred_draft(), INSIDE, [CROP], 40, seed=0)
    start.table[:5, LOGIT] = -9
    fit = DetailFit(start, n_fine, [CROP], 40, seed=0)
    fit._move()
    assert (fit.gaussians.table[:5, LOGIT] > -9).all() and len(fit.gaussians) == len(start)


def test_details_resume_to_the_bit_after_gaussians_have_moved():
    start, n_fine = refined(blurred_draft(), INSIDE, [CROP], 40, seed=0)
    start.table[:5, LOGIT] = -9
    whole, first, second = (DetailFit(start, n_fine, [CROP], 20, seed=0) for _ in range(3))
    whole.run(quiet())
    while first.done < 10:
        first._step()
        first.done += 1
    second.resume(first.state())
    second.run(quiet())
    assert_array_equal(second.gaussians.table, whole.gaussians.table)


@pytest.mark.parametrize(("pixels", "iterations"), [(30 * 36 * 7, 7), (1, 1)])
def test_iterations_follow_the_pixels_of_the_crops(pixels, iterations):
    assert iterations_of([CROP], Quality(100, 10, pixels)) == iterations


def test_a_crop_has_the_object_and_a_margin():
    center = CAMERA.position - 3 * CAMERA.camera_to_world[:3, 2]
    right, up = CAMERA.camera_to_world[:3, 0], CAMERA.camera_to_world[:3, 1]
    corners = np.array([center + x * right + y * up for x in (-0.5, 0.5) for y in (-0.5, 0.5)])
    rows, columns = place_of(corners, CAMERA)
    pixels = CAMERA.project(corners)[0]
    assert 0 <= columns.start < pixels[:, 0].min() and pixels[:, 0].max() < columns.stop <= CAMERA.width
    assert 0 <= rows.start < pixels[:, 1].min() and pixels[:, 1].max() < rows.stop <= CAMERA.height
    assert place_of(CAMERA.position - (corners - CAMERA.position), CAMERA) is None, "behind the camera"
    assert place_of(corners[:0], CAMERA) is None


@pytest.mark.parametrize(("blur", "word"), [(0.5, "sharp"), (2.0, "soft"), (6.0, "poor")])
def test_sharpness_is_the_blur_of_a_photo_in_any_exposure(blur, word):
    photo = np.random.default_rng(0).random((96, 96, 3)).astype(np.float32)
    photo = gaussian_filter(photo, (1, 1, 0))
    shown = 0.8 * gaussian_filter(photo, (blur, blur, 0))
    found = blur_of(shown, photo)
    assert_allclose(found, blur, rtol=0.15)
    assert word_for(found) == word
    valid = np.ones((96, 96), bool)
    valid[:40] = False
    shown[:40] = 1 - photo[:40]
    assert_allclose(blur_of(shown, photo, valid), blur, rtol=0.15)
