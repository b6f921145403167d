"""Loading photos at the working size with their cameras, and detecting the kind of background."""

import gc
import weakref

import cv2
import numpy as np
import OpenEXR
import pytest
from numpy.testing import assert_allclose
from PIL import Image

from blender_tests.engine.reference.pictures import LENS, random_bytes, view_of
from karf_engine.capture import training_images
from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import View
from karf_engine.capture.training_images import background_kind, lens_map, load_views, undistort
from karf_engine.errors import DataError
from karf_engine.io.color import linear_to_srgb
from karf_engine.io.images import resize, write_png

OPAQUE, RGBA = random_bytes(12, 18, 3), random_bytes(12, 18, 4)
BLEEDING = np.array([[[255, 51, 0, 255], *[[0, 255, 0, 0]] * 3]] * 2, np.uint8)  # opaque beside transparent


@pytest.mark.parametrize(
    ("pixels", "long_side", "color", "alpha", "tolerance"),
    [
        (OPAQUE, 9, OPAQUE.reshape(6, 2, 9, 2, 3).mean((1, 3)) / 255, None, 1e-6),
        (RGBA, 400, RGBA[..., :3].astype(np.float32) / 255, RGBA[..., 3].astype(np.float32) / 255, 0),
        (np.dstack([OPAQUE, np.full((12, 18), 255, np.uint8)]), 400, OPAQUE.astype(np.float32) / 255, None, 0),
        (BLEEDING, 2, [[[1.0, 0.2, 0.0], [0, 0, 0]]], [[0.5, 0.0]], 1e-6),
    ],
    ids=["shrunk", "never enlarged", "opaque alpha", "hidden colors do not bleed"],
)
def test_photos_are_read_at_the_long_side_with_straight_colors(tmp_path, pixels, long_side, color, alpha, tolerance):
    (found,) = load_views([view_of(tmp_path / "a.png", pixels)], long_side)
    shown = np.ones(found.color.shape[:2], bool) if pixels is not BLEEDING else found.alpha > 0
    assert found.color.dtype == np.float32 and found.valid is None
    assert_allclose(found.color[shown], np.array(color)[shown], rtol=0, atol=tolerance)
    assert (found.alpha is None) == (alpha is None)
    assert alpha is None or np.abs(found.alpha - alpha).max() <= tolerance


def test_camera_shrinks_with_its_photo(tmp_path):
    camera = load_views([view_of(tmp_path / "a.png", OPAQUE)], 9)[0].camera
    assert (camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy) == (9, 6, 10, 11, 4.5, 3)


def test_shrunken_photo_is_undistorted_with_full_detail(tmp_path):
    camera = Camera(640, 480, 420.0, 410.0, 332.0, 230.0, np.eye(4), (0.12, 0.05, 0.011, -0.0095))
    smooth = cv2.GaussianBlur(np.random.default_rng(10).random((480, 640, 3)), (0, 0), 4)
    pixels = np.uint8(255 * (smooth - smooth.min()) / np.ptp(smooth))
    write_png(tmp_path / "a.png", pixels)
    (found,) = load_views([View("a", "a", camera, tmp_path / "a.png", "train")], 100)
    straight, _, valid = undistort(pixels / 255, camera)
    seen = resize(valid.astype(float), 100, 75) > 0.999
    difference = np.abs(found.color - resize(straight, 100, 75))[seen & found.valid]
    assert difference.max() < 0.03 and np.sqrt((difference**2).mean()) < 0.004
    assert (seen != found.valid).mean() < 0.02 and 0 < (~found.valid).mean() < 0.5
    assert found.camera.distortion == ()


def test_lens_map_is_computed_once_per_lens(tmp_path):
    lens_map.cache_clear()
    load_views([view_of(tmp_path / f"{i}.png", OPAQUE, LENS if i % 2 else LENS[:4]) for i in range(6)], 9)
    assert lens_map.cache_info().misses == 2


@pytest.mark.parametrize(("size", "turn"), [((16, 32), 3), ((32, 16), 0)])
def test_photos_are_rotated_as_their_camera_expects(tmp_path, size, turn):
    pixels = np.zeros((16, 32, 3), np.uint8)
    pixels[:8, :8] = 255
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.fromarray(pixels).save(tmp_path / "a.jpg", exif=exif, quality=100)
    camera = Camera(*size, 20.0, 20.0, size[0] / 2, size[1] / 2, np.eye(4))
    (found,) = load_views([View("a", "a", camera, tmp_path / "a.jpg", "train")], 100)
    assert_allclose(found.color, np.rot90(pixels / 255, turn), atol=0.05)


def test_photo_of_another_size_than_its_camera_is_rejected(tmp_path):
    with pytest.raises(DataError, match=r"a\.png is 18x12 pixels where its camera has 20x12"):
        load_views([view_of(tmp_path / "a.png", OPAQUE, size=(20, 12))], 9)


def test_photos_of_mixed_kinds_are_loaded_one_at_a_time(tmp_path, monkeypatch):
    OpenEXR.File({}, {"RGB": np.full((8, 24, 3), 0.18, np.float32)}).write(str(tmp_path / "d.exr"))
    views = [
        view_of(tmp_path / "a.png", OPAQUE),
        view_of(tmp_path / "b.png", random_bytes(30, 20, 4)),
        view_of(tmp_path / "c.png", random_bytes(6, 4, 3), LENS),
        View("d", "d", Camera(24, 8, 20.0, 20.0, 12.0, 4.0, np.eye(4)), tmp_path / "d.exr", "test"),
    ]
    alive, read = [], training_images.read_photo

    def read_alone(path, *how):
        gc.collect()
        assert not any(reference() is not None for reference in alive)
        photo = read(path, *how)
        alive.append(weakref.ref(photo))
        return photo

    monkeypatch.setattr(training_images, "read_photo", read_alone)
    found = load_views(views, 12)
    assert len(alive) == 4
    sizes = [each.color.shape[1::-1] for each in found]
    assert sizes == [(each.camera.width, each.camera.height) for each in found] == [(12, 8), (8, 12), (4, 6), (12, 4)]
    assert [each.alpha is not None for each in found] == [False, True, False, False]
    assert_allclose(found[3].color, linear_to_srgb(np.float64(0.18)), atol=1e-6)


def framed(color):
    """A photo with a uniform gray border except where the object touches it."""
    photo = np.random.default_rng(4).uniform(0.2, 0.8, size=(20, 30, 3))
    for border in (photo[:2], photo[-2:], photo[:, :2], photo[:, -2:]):
        border[:] = color
    photo[0, 10:20] = 0.5
    return photo


PHOTO, BLACK = np.full((20, 30, 3), 0.5), framed(0.01)
MATTE = np.dstack([PHOTO, np.arange(20)[:, None].repeat(30, 1) >= 5])
HIDDEN = np.zeros((4, 4, 4), np.float32)


@pytest.mark.parametrize(
    ("photos", "kind"),
    [
        ([PHOTO] * 3, "opaque"),
        ([BLACK] * 2 + [PHOTO], "opaque"),
        ([BLACK] * 3, "black"),
        ([BLACK] * 9 + [PHOTO], "black"),
        ([np.dstack([BLACK, np.ones((20, 30))])] * 3, "black"),
        ([framed(0.99)] * 3, "white"),
        ([MATTE] * 3, "alpha"),
        ([HIDDEN, MATTE], "alpha"),
    ],
)
def test_each_kind_of_background_is_recognized(photos, kind):
    assert background_kind(photos) == kind


def test_entirely_transparent_photos_are_rejected():
    with pytest.raises(DataError, match="All photos are transparent everywhere") as caught:
        background_kind([HIDDEN] * 3)
    assert caught.value.hint
