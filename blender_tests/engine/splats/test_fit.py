"""Gaussians learn what photos show, hold what lies behind, and resume where they were interrupted."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

torch = pytest.importorskip("torch")
pytest.importorskip("numba")

from blender_tests.engine.splats.clouds import BACKGROUND, GROUPS, NEAR, ball, camera_ahead, cloud
from karf_engine.compute import cores
from karf_engine.compute.progress import Progress
from karf_engine.errors import Cancelled, DataError, Diverged
from karf_engine.fields.fit import Checkpoint
from karf_engine.io.color import to_bytes
from karf_engine.splats import fit as fit_module
from karf_engine.splats.fit import Photo, SplatFit
from karf_engine.splats.gaussians import Gaussians
from karf_engine.splats.kernels.arrays import CENTER, COLOR, LOG_SCALE
from karf_engine.splats.rasterizer import RasterizedView, pinhole, rasterize

TRUTH = Gaussians(cloud(40, 1, seed=7), 0, BACKGROUND, NEAR)


def moved(camera, x, y):
    pose = camera.camera_to_world.copy()
    pose[:2, 3] = x, y
    return replace(camera, camera_to_world=pose)


CAMERAS = [moved(camera_ahead(), x, y) for x in (-0.6, 0.6) for y in (-0.6, 0, 0.6)]


def photo_of(camera, gaussians=TRUTH):
    """An opaque photo of these Gaussians."""
    return Photo(camera, to_bytes(rasterize(gaussians, camera).image[..., :3].clip(0, 1)), None, None)


def cut_out_of(camera):
    """The same without what is behind them."""
    image = RasterizedView(TRUTH.table, pinhole(camera, NEAR), (0, 0, 0)).image
    alpha = 1 - image[..., 3]
    straight = np.divide(
        image[..., :3], alpha[..., None], out=np.zeros_like(image[..., :3]), where=alpha[..., None] > 0
    )
    return Photo(camera, to_bytes(straight.clip(0, 1)), alpha, None)


def unlearned(seed=8):
    """The truth, a little off in everything."""
    table = TRUTH.table + np.random.default_rng(seed).normal(0, 0.1, TRUTH.table.shape).astype(np.float32)
    return replace(TRUTH, table=table)


def progress(steps=None):
    """Progress that is cancelled after so many steps."""
    asked = iter(range(steps)) if steps is not None else None
    return Progress(lambda *_, **__: None, lambda: asked is not None and next(asked, None) is None, "splats", 100)


def learn(start, photos, iterations, **more):
    fit = SplatFit(start, photos, iterations, 0, **more)
    fit.run(progress())
    return fit.gaussians


def spy_on_photos(fit, shown, monkeypatch):
    """Note the pictures that a fit looks at."""
    view_of = fit._photo
    monkeypatch.setattr(fit, "_photo", lambda random: shown.append(view_of(random)[0]) or view_of(random))


def error_of(gaussians, photos):
    shown = [rasterize(gaussians, photo.camera).image[..., :3] - photo.over(BACKGROUND) for photo in photos]
    return float(np.square(shown).mean())


# --------------------------------------------------------------------------------------------------------------- learning
def test_gaussians_become_what_the_photos_show():
    photos, start = [photo_of(camera) for camera in CAMERAS], unlearned()
    learned = learn(start, photos, 150)
    held_out = [photo_of(moved(camera_ahead(), 0.2, -0.3))]
    assert error_of(learned, photos) < 0.05 * error_of(start, photos)
    assert error_of(learned, held_out) < 0.2 * error_of(start, held_out)


def test_what_is_begun_with_is_not_changed():
    start = unlearned()
    before = start.table.copy()
    learn(start, [photo_of(CAMERAS[0])], 3)
    assert_array_equal(start.table, before)


def test_the_seed_decides_and_the_cores_do_not():
    photos, counted = [photo_of(camera) for camera in CAMERAS], cores.core_count()
    found = []
    try:
        for count in (1, 2):
            cores.set_core_count(count)
            cores.limit_torch_threads()
            found.append(learn(unlearned(), photos, 12).table)
    finally:
        cores.set_core_count(counted)
    assert_array_equal(*found)
    other = SplatFit(unlearned(), photos, 12, 1)
    other.run(progress())
    assert (other.gaussians.table != found[0]).any()


def test_every_photo_is_shown_once_before_one_is_shown_again(monkeypatch):
    photos = [photo_of(camera) for camera in CAMERAS]
    fit, shown = SplatFit(unlearned(), photos, 18, 0), []
    spy_on_photos(fit, shown, monkeypatch)
    fit.run(progress())
    places = [photo.camera.camera_to_world[:2, 3].tolist() for photo in shown]
    rounds = [places[first : first + 6] for first in (0, 6, 12)]
    assert all(sorted(each) == sorted(camera.camera_to_world[:2, 3].tolist() for camera in CAMERAS) for each in rounds)
    assert rounds[0] != rounds[1] or rounds[1] != rounds[2]


def test_photos_are_shown_at_half_their_size_first(monkeypatch):
    fit, shown = SplatFit(unlearned(), [photo_of(camera) for camera in CAMERAS], 10, 0), []
    spy_on_photos(fit, shown, monkeypatch)
    fit.run(progress())
    assert [photo.color.shape[:2] for photo in shown] == [(18, 20)] * 6 + [(36, 40)] * 4
    assert {(photo.camera.width, photo.camera.fx) for photo in shown} == {(20, 25.0), (40, 50.0)}


def test_a_photo_of_half_the_size_is_cut_out_and_known_where_the_whole_is():
    photo = cut_out_of(CAMERAS[0])
    valid = np.ones((36, 40), bool)
    valid[5, 7] = False
    half = replace(photo, valid=valid).halved()
    np.testing.assert_allclose(half.alpha, photo.alpha.reshape(18, 2, 20, 2).mean((1, 3)), atol=0.02)
    assert np.argwhere(~half.valid).tolist() == [[2, 3]]
    assert half.color.shape == (18, 20, 3) and half.color.dtype == np.uint8


def test_pixels_of_which_nothing_is_known_teach_nothing():
    photo = photo_of(CAMERAS[0])
    valid = np.ones(photo.color.shape[:2], bool)
    valid[:, 20:] = False
    blotted = photo.color.copy()
    blotted[:, 20:] = 255
    found = [
        learn(unlearned(), [replace(photo, color=color, valid=valid)], 4).table for color in (photo.color, blotted)
    ]
    assert_array_equal(*found)


def test_no_gaussian_becomes_finer_than_the_photos_show():
    start = unlearned()
    start.table[:, GROUPS["scales"]] = -12
    learned = learn(start, [photo_of(camera) for camera in CAMERAS], 6)
    pixel = 3 / 50  # of the nearest Gaussian, some three units from the cameras
    assert np.exp(learned.table[:, GROUPS["scales"]]).min() > 0.05 * pixel


# ------------------------------------------------------------------------------------------ pictures between the photos
def test_pictures_between_the_photos_take_turns_with_them(monkeypatch):
    photos, between = [photo_of(camera) for camera in CAMERAS[:2]], [photo_of(camera) for camera in CAMERAS[2:5]]
    fit, shown = SplatFit(unlearned(), photos, 18, 0, pseudo_photos=between), []
    spy_on_photos(fit, shown, monkeypatch)
    fit.run(progress())
    places = [tuple(photo.camera.camera_to_world[:2, 3]) for photo in shown]
    of_cameras = [tuple(camera.camera_to_world[:2, 3]) for camera in CAMERAS]
    of_photos, of_pictures = places[::3], [place for number, place in enumerate(places) if number % 3]
    for first in range(0, 6, 2):
        assert set(of_photos[first : first + 2]) == set(of_cameras[:2])
    for first in range(0, 12, 3):
        assert set(of_pictures[first : first + 3]) == set(of_cameras[2:5])


def test_what_no_photo_shows_is_learned_from_pictures_between_them():
    photos, between = [photo_of(CAMERAS[0])], [photo_of(camera) for camera in CAMERAS[1:]]
    of_photo_alone, of_both = learn(unlearned(), photos, 120), learn(unlearned(), photos, 120, pseudo_photos=between)
    new = [photo_of(moved(camera_ahead(), 0.5, 0.3))]
    assert error_of(of_both, new) < 0.3 * error_of(of_photo_alone, new)


def test_pictures_between_photos_tell_nothing_of_how_these_are_exposed(monkeypatch):
    photos = [photo_of(camera) for camera in CAMERAS]
    darker = [replace(photo, color=photo.color // 2) for photo in photos]
    monkeypatch.setattr(fit_module, "RATES", {0: 0.0})
    fit = SplatFit(TRUTH, photos, 36, 0, pseudo_photos=darker)
    fit.run(progress())
    np.testing.assert_allclose(fit.gains, 1, atol=0.01)


# ------------------------------------------------------------------------------------------------ cut-outs, large photos
def test_only_what_is_solid_can_show_a_cut_out_before_backgrounds_that_change():
    photos = [cut_out_of(camera) for camera in CAMERAS]
    start = unlearned()
    start.table[:, GROUPS["opacity"]] = 0
    learned = learn(start, photos, 150)
    errors = []
    for gaussians in (start, learned):
        view = rasterize(gaussians, CAMERAS[0])
        errors.append(np.abs(1 - view.image[..., 3] - photos[0].alpha).mean())
    assert errors[1] < 0.4 * errors[0]
    assert error_of(learned, photos) < 0.1 * error_of(start, photos)


def test_the_background_of_a_cut_out_is_another_each_time_and_that_of_a_photo_its_own(monkeypatch):
    seen = []
    view_of = fit_module.RasterizedView
    monkeypatch.setattr(fit_module, "RasterizedView", lambda *given: seen.append(given[2]) or view_of(*given))
    learn(unlearned(), [cut_out_of(CAMERAS[0])], 4)
    assert len(set(seen)) == 4
    seen.clear()
    learn(unlearned(), [photo_of(CAMERAS[0])], 2)
    assert seen == [BACKGROUND, BACKGROUND]


def test_a_window_shows_what_the_photo_shows_there(monkeypatch):
    monkeypatch.setattr(fit_module, "WINDOW", 16)
    photo = cut_out_of(CAMERAS[1])
    photo = replace(photo, valid=photo.alpha > 0.5)
    part = photo.window(9, 5)
    assert (part.camera.width, part.camera.height) == (16, 16)
    assert_array_equal(part.color, photo.color[5:21, 9:25])
    assert_array_equal(part.alpha, photo.alpha[5:21, 9:25])
    assert_array_equal(part.valid, photo.valid[5:21, 9:25])
    whole = rasterize(TRUTH, photo.camera).image[5:21, 9:25]
    np.testing.assert_allclose(rasterize(TRUTH, part.camera).image, whole, atol=1e-4)


def test_large_photos_are_learned_from_in_windows_all_over_them(monkeypatch):
    monkeypatch.setattr(fit_module, "WINDOW", 16)
    photos, start = [photo_of(camera) for camera in CAMERAS], unlearned()
    learned = learn(start, photos, 250)
    whole = [error_of(gaussians, photos) for gaussians in (start, learned)]
    assert whole[1] < 0.2 * whole[0]


# ------------------------------------------------------------------------------------------------------- what is behind
def test_what_lies_behind_keeps_its_place_and_shape_and_looks_the_same_from_everywhere():
    shell = np.stack([ball((x, y, -20), 4, 0.99, (0.5, 0.5, 0.5), 1) for x in (-6, 0, 6) for y in (-6, 0, 6)])
    start = replace(unlearned(), table=np.concatenate([unlearned().table, shell]), n_background=len(shell))
    learned = learn(start, [photo_of(camera) for camera in CAMERAS], 30)
    behind = learned.table[learned.n_foreground :]
    assert_array_equal(behind[:, :COLOR], shell[:, :COLOR])
    assert_array_equal(behind[:, COLOR + 3 :], shell[:, COLOR + 3 :])
    assert (behind[:, GROUPS["color"]] != shell[:, GROUPS["color"]]).any()
    assert (learned.table[: learned.n_foreground, :LOG_SCALE] != start.table[: start.n_foreground, :LOG_SCALE]).any()


# -------------------------------------------------------------------------------------------------------- interruptions
def checkpoint(folder, name="unfinished"):
    return Checkpoint(folder / f"{name}.safetensors", "of these inputs", "splats", lambda *_, **__: None)


@pytest.mark.parametrize("n_between", [0, 2])
def test_a_fit_that_is_cancelled_again_and_again_ends_where_an_uninterrupted_one_does(tmp_path, n_between):
    photos = [*(photo_of(camera) for camera in CAMERAS[:3]), cut_out_of(CAMERAS[3])]
    between = [photo_of(camera) for camera in CAMERAS[4 : 4 + n_between]]
    whole = learn(unlearned(), photos, 20, pseudo_photos=between).table
    for stop, stood in ((7, 8), (5, 14)):  # the step at which it is asked is done
        fit, saved = SplatFit(unlearned(), photos, 20, 0, pseudo_photos=between), checkpoint(tmp_path)
        with pytest.raises(Cancelled):
            saved.attach(fit, count := progress(stop))
            fit.run(count, saved)
        assert fit.done == stood
    fit, saved = SplatFit(unlearned(), photos, 20, 0, pseudo_photos=between), checkpoint(tmp_path)
    saved.attach(fit, progress())
    assert fit.done == 14
    fit.run(progress(), saved)
    assert_array_equal(fit.gaussians.table, whole)


def other_table(state):
    state["table"] = state["table"][:-1]


def other_type(state):
    state["steps"] = state["steps"].float()


def too_many_done(state):
    state["done"] = state["done"] + 1000


@pytest.mark.parametrize("change", [other_table, other_type, too_many_done, lambda state: state.pop("means")])
def test_a_state_of_another_fit_is_refused_and_nothing_of_it_taken_over(change):
    photos = [photo_of(CAMERAS[0])]
    ahead, fit = SplatFit(unlearned(), photos, 6, 0), SplatFit(unlearned(), photos, 6, 0)
    ahead.run(progress())
    state = ahead.state()
    change(state)
    with pytest.raises(DataError):
        fit.resume(state)
    assert fit.done == 0
    assert_array_equal(fit.gaussians.table, unlearned().table)


@pytest.mark.parametrize("column", [COLOR, CENTER])
def test_learning_that_leaves_the_numbers_stops_with_a_sentence(column, monkeypatch):
    monkeypatch.setitem(fit_module.RATES, column, np.inf)
    fit = SplatFit(unlearned(), [photo_of(camera) for camera in CAMERAS], 20, 0)
    with pytest.raises(Diverged, match="diverged at iteration") as caught:
        fit.run(progress())
    assert caught.value.hint and fit.done < 20
