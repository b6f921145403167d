"""Fitting Gaussians to photos: convergence, exposure gains, and exact resume."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

pytest.importorskip("numba")

from blender_tests.engine.splats.clouds import BACKGROUND, GROUPS, NEAR, ball, camera_ahead, cloud
from karf_engine.compute import cores
from karf_engine.compute.progress import Progress
from karf_engine.errors import Cancelled, DataError, Diverged
from karf_engine.fields.fit import Checkpoint
from karf_engine.io.color import to_bytes
from karf_engine.splats import fit as fit_module
from karf_engine.splats.compiled import CompiledTable
from karf_engine.splats.fit import Exposures, Photo, SplatFit, interpolate_gains
from karf_engine.splats.gaussians import Gaussians
from karf_engine.splats.kernels.arrays import CENTER, COLOR, LOG_SCALE
from karf_engine.splats.rasterizer import rasterize

TRUTH = Gaussians(cloud(40, 1, seed=7), 0, BACKGROUND, NEAR)


def camera_at(x, y):
    camera = camera_ahead()
    camera.camera_to_world[:2, 3] = x, y
    return camera


def photo_of(camera):
    return Photo(camera, to_bytes(rasterize(TRUTH, camera).image[..., :3].clip(0, 1)), None, None)


def cut_out_of(camera):
    """The same view with alpha instead of the background."""
    image = rasterize(replace(TRUTH, background=(0, 0, 0)), camera).image
    alpha = 1 - image[..., 3]
    straight = np.divide(
        image[..., :3], alpha[..., None], out=np.zeros_like(image[..., :3]), where=alpha[..., None] > 0
    )
    return Photo(camera, to_bytes(straight.clip(0, 1)), alpha, None)


def noisy_truth(seed=8):
    """The truth with noise on every value."""
    table = TRUTH.table + np.random.default_rng(seed).normal(0, 0.1, TRUTH.table.shape).astype(np.float32)
    return replace(TRUTH, table=table)


CAMERAS = [camera_at(x, y) for x in (-0.6, 0.6) for y in (-0.6, 0, 0.6)]
PHOTOS, CUT_OUTS = ([photograph(camera) for camera in CAMERAS] for photograph in (photo_of, cut_out_of))


def progress(steps=np.inf):
    """Progress that is cancelled after this many steps."""
    asked = count()
    return Progress(lambda *_, **__: None, lambda: next(asked) >= steps, "splats", 100)


def fitted(photos, iterations, start=None, seed=0, **more):
    fit = SplatFit(start or noisy_truth(), photos, iterations, seed, **more)
    fit.run(progress())
    return fit


def photos_shown(monkeypatch, *given, **more):
    fit, shown = SplatFit(noisy_truth(), *given, 0, **more), []
    view_of = fit._photo
    monkeypatch.setattr(fit, "_photo", lambda random: shown.append(view_of(random)[0]) or view_of(random))
    fit.run(progress())
    return shown


def place(camera):
    return tuple(camera.camera_to_world[:2, 3])


def error_of(gaussians, photos):
    shown = [rasterize(gaussians, photo.camera).image[..., :3] - photo.over(BACKGROUND) for photo in photos]
    return float(np.square(shown).mean())


@pytest.mark.parametrize(
    ("photos", "iterations", "window", "share"),
    [(PHOTOS, 150, None, 0.05), (CUT_OUTS, 150, None, 0.1), (PHOTOS, 250, 16, 0.2)],
    ids=["opaque", "cutout", "larger than the window"],
)
def test_fit_reproduces_the_photos(photos, iterations, window, share, monkeypatch):
    if window:
        monkeypatch.setattr(fit_module, "WINDOW", window)
    start = noisy_truth()
    if photos is CUT_OUTS:
        start.table[:, GROUPS["opacity"]] = 0
    before = start.table.copy()
    learned = fitted(photos, iterations, start).gaussians
    assert_array_equal(start.table, before)
    assert error_of(learned, photos) < share * error_of(start, photos)
    if photos is CUT_OUTS:  # random backgrounds force the objects to become solid
        light = [rasterize(gaussians, CAMERAS[0]).image[..., 3] for gaussians in (start, learned)]
        errors = [np.abs(1 - each - photos[0].alpha).mean() for each in light]
        assert errors[1] < 0.4 * errors[0]
    elif not window:
        held_out = [photo_of(camera_at(0.2, -0.3))]
        assert error_of(learned, held_out) < 0.2 * error_of(start, held_out)


def test_result_depends_on_seed_but_not_on_core_count():
    found, before = [], cores.core_count()
    try:
        for number in (1, 2):
            cores.set_core_count(number)
            cores.limit_torch_threads()
            found.append(fitted(PHOTOS, 12).gaussians.table)
    finally:
        cores.set_core_count(before)
    assert_array_equal(*found)
    assert (fitted(PHOTOS, 12, seed=1).gaussians.table != found[0]).any()


def test_epochs_start_at_half_size_and_include_pseudo_photos(monkeypatch):
    shown = photos_shown(monkeypatch, PHOTOS, 18)
    rounds = [[place(photo.camera) for photo in shown[first : first + 6]] for first in (0, 6, 12)]
    assert all(sorted(each) == sorted(map(place, CAMERAS)) for each in rounds)
    assert rounds[0] != rounds[1] or rounds[1] != rounds[2]
    sizes = [(*photo.color.shape[:2], photo.camera.width, photo.camera.fx) for photo in shown]
    assert sizes == [(18, 20, 20, 25.0)] * 11 + [(36, 40, 40, 50.0)] * 7
    shown = photos_shown(monkeypatch, PHOTOS[:2], 18, pseudo_photos=PHOTOS[2:5])
    numbers = [[place(camera) for camera in CAMERAS].index(place(photo.camera)) for photo in shown]
    assert [set(numbers[first : first + 6 : 3]) for first in (0, 6, 12)] == [{0, 1}] * 3
    between = [number for at, number in enumerate(numbers) if at % 3]
    assert [set(between[first : first + 3]) for first in (0, 3, 6, 9)] == [{2, 3, 4}] * 4


def test_halved_and_cropped_photos_match_the_original():
    valid = np.ones((36, 40), bool)
    valid[5, 7] = False
    photo = replace(CUT_OUTS[1], valid=valid)
    half = photo.halved()
    assert_allclose(half.alpha, photo.alpha.reshape(18, 2, 20, 2).mean((1, 3)), atol=0.02)
    assert np.argwhere(~half.valid).tolist() == [[2, 3]]
    assert half.color.shape == (18, 20, 3) and half.color.dtype == np.uint8
    rows, columns = slice(5, 21), slice(9, 25)
    part = photo.cropped(rows, columns)
    assert (part.camera.width, part.camera.height) == (16, 16)
    for name in ("color", "alpha", "valid"):
        assert_array_equal(getattr(part, name), getattr(photo, name)[rows, columns])
    whole = rasterize(TRUTH, photo.camera).image[rows, columns]
    assert_allclose(rasterize(TRUTH, part.camera).image, whole, atol=1e-4)


def test_invalid_pixels_do_not_affect_the_fit():
    valid = np.ones((36, 40), bool)
    valid[:, 20:] = False
    blotted = PHOTOS[0].color.copy()
    blotted[:, 20:] = 255
    photos = [replace(PHOTOS[0], color=color, valid=valid) for color in (PHOTOS[0].color, blotted)]
    assert_array_equal(*(fitted([photo], 4).gaussians.table for photo in photos))


def test_gaussians_do_not_shrink_below_photo_resolution():
    start = noisy_truth()
    start.table[:, GROUPS["scales"]] = -12
    pixel = 3 / 50  # the nearest Gaussian is about three units from the cameras
    assert np.exp(fitted(PHOTOS, 6, start).gaussians.table[:, GROUPS["scales"]]).min() > 0.05 * pixel


def test_cutouts_are_fitted_on_random_backgrounds(monkeypatch):
    seen, view_of = [], CompiledTable.view
    monkeypatch.setattr(CompiledTable, "view", lambda *given: seen.append(given[2]) or view_of(*given))
    fitted(CUT_OUTS[:1], 4)
    assert len(set(seen)) == 4
    fitted(PHOTOS[:1], 2)
    assert seen[4:] == [BACKGROUND, BACKGROUND]


def test_background_gaussians_learn_only_their_color():
    shell = np.stack([ball((x, y, -20), 4, 0.99, (0.5, 0.5, 0.5), 1) for x in (-6, 0, 6) for y in (-6, 0, 6)])
    start = replace(noisy_truth(), table=np.concatenate([noisy_truth().table, shell]), n_background=len(shell))
    changed = fitted(PHOTOS, 30, start).gaussians.table != start.table
    background = changed[start.n_foreground :]
    assert not background[:, :COLOR].any() and not background[:, COLOR + 3 :].any()
    assert background[:, GROUPS["color"]].any() and changed[: start.n_foreground, :LOG_SCALE].any()


GAINS = np.float32([[1.15, 1.1, 1], [0.9, 0.95, 1], [1, 1, 1], [1.05, 1, 0.95], [0.9, 0.95, 1], [1.02, 1.01, 1.05]])


def exposed(photo, gains):
    return replace(photo, color=to_bytes((gains * photo.color / np.float32(255)).clip(0, 1)))


ONES = np.ones((6, 3), np.float32)


def test_fit_recovers_gains_and_renders_at_mean_exposure():
    fit = fitted([exposed(photo, gains) for photo, gains in zip(PHOTOS, GAINS, strict=True)], 240)
    mean = np.exp(np.log(GAINS).mean(0))
    assert_allclose(fit.gains, GAINS / mean, atol=0.04)
    equal = fitted(PHOTOS, 240)
    assert_allclose(equal.gains, ONES, atol=0.01)
    assert error_of(fit.gaussians, [exposed(photo, mean) for photo in PHOTOS]) < 3 * error_of(equal.gaussians, PHOTOS)


def test_cutouts_pseudo_photos_and_equal_exposures_keep_unit_gains(monkeypatch):
    darkened = [exposed(photo, gains) for photo, gains in zip(PHOTOS, GAINS, strict=True)]
    assert_array_equal(fitted(darkened, 20, fits_exposures=False).gains, ONES)
    cut_outs = [exposed(photo, gains) for photo, gains in zip(CUT_OUTS, GAINS, strict=True)]
    assert_array_equal(fitted(cut_outs, 20).gains, ONES)
    monkeypatch.setattr(fit_module, "RATES", {0: 0.0})
    darker = [replace(photo, color=photo.color // 2) for photo in PHOTOS]
    assert_allclose(fitted(PHOTOS, 36, TRUTH, pseudo_photos=darker).gains, ONES, atol=0.01)


def test_gains_ignore_clipped_pixels_and_noise():
    shown = np.float32([[0.4, 0.4, 0.4], [0.9, 0.9, 0.9]])
    photo = np.minimum(shown * 1.5, 1)
    exposures, without, black = (Exposures(1) for _ in range(3))
    exposures.update(0, shown, photo)
    without.update(0, shown[:1], photo[:1])
    black.update(0, shown, np.zeros((2, 3), np.float32))
    assert_array_equal(exposures.measured, without.measured)
    assert (exposures.measured > 1.1).all()
    assert_allclose(black.measured, 1)
    gray, believed = np.full((10, 3), 0.5, np.float32), {}
    for spread in (0.002, 0.2):
        exposures = Exposures(2)
        for _ in range(20):
            exposures.update(0, gray, gray * (1 + spread))
            exposures.update(1, gray, gray / (1 + spread))
        exposures.balance()
        believed[spread] = np.log(exposures.gains[0]) / np.log(exposures.measured[0])
    assert (believed[0.002] < 0.1).all() and (believed[0.2] > 0.9).all()


def test_held_out_photos_get_interpolated_gains():
    assert_allclose(interpolate_gains(GAINS[:2], [0, 4], 1), 0.75 * GAINS[0] + 0.25 * GAINS[1], rtol=1e-6)
    assert_allclose(interpolate_gains(GAINS[:2], [0, 4], 9), GAINS[1])


@pytest.mark.parametrize("between", [[], PHOTOS[4:]])
def test_resumed_fit_equals_uninterrupted_fit(tmp_path, between):
    photos = [*PHOTOS[:3], CUT_OUTS[3]]

    def resumed(stop=np.inf):
        saved = Checkpoint(tmp_path / "unfinished.safetensors", "of these inputs", "splats", lambda *_, **__: None)
        fit, steps = SplatFit(noisy_truth(), photos, 20, 0, pseudo_photos=between), progress(stop)
        saved.attach(fit, steps)
        return fit, lambda: fit.run(steps, saved)

    for stop, done in ((7, 8), (5, 14)):  # the current step is finished before it stops
        fit, run = resumed(stop)
        with pytest.raises(Cancelled):
            run()
        assert fit.done == done
    fit, run = resumed()
    assert fit.done == 14
    run()
    assert_array_equal(fit.gaussians.table, fitted(photos, 20, pseudo_photos=between).gaussians.table)


@pytest.mark.parametrize(
    "change",
    [
        lambda state: state.update(table=state["table"][:-1]),
        lambda state: state.update(steps=state["steps"].float()),
        lambda state: state.update(done=state["done"] + 1000),
        lambda state: state.pop("means"),
    ],
    ids=["wrong shape", "wrong type", "step past the end", "missing entry"],
)
def test_resume_rejects_state_of_another_fit_and_changes_nothing(change):
    state, fit = fitted(PHOTOS[:1], 6).state(), SplatFit(noisy_truth(), PHOTOS[:1], 6, 0)
    change(state)
    with pytest.raises(DataError):
        fit.resume(state)
    assert fit.done == 0
    assert_array_equal(fit.gaussians.table, noisy_truth().table)


@pytest.mark.parametrize("column", [COLOR, CENTER])
def test_diverging_fit_raises_a_readable_error(column, monkeypatch):
    monkeypatch.setitem(fit_module.RATES, column, np.inf)
    fit = SplatFit(noisy_truth(), PHOTOS, 20, 0)
    with pytest.raises(Diverged, match="diverged at iteration") as caught:
        fit.run(progress())
    assert caught.value.hint and fit.done < 20
