"""Photos that are exposed differently are explained by gains, not by the scene."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

pytest.importorskip("torch")
pytest.importorskip("numba")

from blender_tests.engine.splats.test_fit import CAMERAS, cut_out_of, error_of, photo_of, progress, unlearned
from karf_engine.io.color import to_bytes
from karf_engine.splats.fit import Exposures, SplatFit, interpolate_gains

GAINS = np.float32([[1.15, 1.1, 1], [0.9, 0.95, 1], [1, 1, 1], [1.05, 1, 0.95], [0.9, 0.95, 1], [1.02, 1.01, 1.05]])


def exposed(photo, gains):
    return replace(photo, color=to_bytes((gains * photo.color / np.float32(255)).clip(0, 1)))


def fitted(photos, iterations=240):
    fit = SplatFit(unlearned(), photos, iterations, 0)
    fit.run(progress())
    return fit


def test_the_gains_are_found_and_the_scene_has_the_mean_exposure():
    photos = [photo_of(camera) for camera in CAMERAS]
    fit = fitted([exposed(photo, gains) for photo, gains in zip(photos, GAINS, strict=True)])
    mean = np.exp(np.log(GAINS).mean(0))
    assert_allclose(fit.gains, GAINS / mean, atol=0.04)
    among_alike = fitted(photos).gaussians
    in_mean = [exposed(photo, mean) for photo in photos]
    assert error_of(fit.gaussians, in_mean) < 3 * error_of(among_alike, photos)


def test_photos_exposed_alike_keep_gains_of_1():
    assert_allclose(fitted([photo_of(camera) for camera in CAMERAS]).gains, 1, atol=0.01)


def test_photos_with_a_matte_count_as_exposed_alike():
    photos = [exposed(cut_out_of(camera), gains) for camera, gains in zip(CAMERAS, GAINS, strict=True)]
    assert_array_equal(fitted(photos, 20).gains, 1)


def test_clipped_pixels_tell_nothing():
    shown = np.float32([[0.4, 0.4, 0.4], [0.9, 0.9, 0.9]])
    photo = np.minimum(shown * 1.5, 1)
    exposures, without = Exposures(1), Exposures(1)
    exposures.update(0, shown, photo)
    without.update(0, shown[:1], photo[:1])
    assert_array_equal(exposures.measured, without.measured)
    assert (exposures.measured > 1.1).all()
    black = Exposures(1)
    black.update(0, shown, np.zeros((2, 3), np.float32))
    assert_allclose(black.measured, 1)


def test_gains_are_believed_as_far_as_photos_differ_more_than_they_would_by_chance():
    shown = np.full((10, 3), 0.5, np.float32)
    believed = {}
    for spread in (0.002, 0.2):
        exposures = Exposures(2)
        for _ in range(20):
            exposures.update(0, shown, shown * (1 + spread))
            exposures.update(1, shown, shown / (1 + spread))
        exposures.balance()
        believed[spread] = np.log(exposures.gains[0]) / np.log(exposures.measured[0])
    assert (believed[0.002] < 0.1).all() and (believed[0.2] > 0.9).all()


def test_a_held_out_photo_is_exposed_as_its_neighbors():
    assert_allclose(interpolate_gains(GAINS[:2], [0, 4], 1), 0.75 * GAINS[0] + 0.25 * GAINS[1], rtol=1e-6)
    assert_allclose(interpolate_gains(GAINS[:2], [0, 4], 9), GAINS[1])
