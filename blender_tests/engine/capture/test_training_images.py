"""Photos at the working size with their cameras, and what surrounds the objects in them."""

import gc
import weakref

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

cv2 = pytest.importorskip("cv2")
pytest.importorskip("scipy")
pytest.importorskip("imageio.v3")
Image = pytest.importorskip("PIL.Image")
OpenEXR = pytest.importorskip("OpenEXR")

from blender_tests.engine.reference.pictures import LENS, random_bytes, view_of
from karf_engine.capture import training_images
from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import View
from karf_engine.capture.training_images import background_kind, lens_map, load_views, undistort
from karf_engine.errors import DataError
from karf_engine.io.color import linear_to_srgb
from karf_engine.io.images import resize, write_png


def load(path, pixels, long_side, **options):
    """The training image of a photo with these pixels."""
    (found,) = load_views([view_of(path / "a.png", pixels, **options)], long_side)
    return found


def test_photos_shrink_to_the_long_side_with_their_camera(tmp_path):
    pixels = random_bytes(12, 18, 3)
    found = load(tmp_path, pixels, 9)
    assert found.color.shape == (6, 9, 3) and found.color.dtype == np.float32
    assert_allclose(found.color, pixels.reshape(6, 2, 9, 2, 3).mean((1, 3)) / 255, atol=1e-6)
    camera = found.camera
    assert (camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy) == (9, 6, 10, 11, 4.5, 3)
    assert found.alpha is None and found.valid is None


def test_photos_are_never_enlarged_and_then_keep_every_stored_color(tmp_path):
    pixels = random_bytes(12, 18, 4)
    found = load(tmp_path, pixels, 400)
    assert_array_equal(found.color, pixels[..., :3].astype(np.float32) / 255)
    assert_array_equal(found.alpha, pixels[..., 3].astype(np.float32) / 255)


def test_hidden_colors_do_not_bleed_into_shrunken_photos(tmp_path):
    pixels = np.zeros((2, 4, 4), np.uint8)
    pixels[:, 0] = [255, 51, 0, 255]  # orange and opaque beside green and fully transparent
    pixels[:, 1:] = [0, 255, 0, 0]
    found = load(tmp_path, pixels, 2)
    assert_allclose(found.alpha, [[0.5, 0.0]])
    assert_allclose(found.color[0, 0], [1.0, 0.2, 0.0], atol=1e-6)


def test_an_alpha_of_255_everywhere_is_no_matte(tmp_path):
    pixels = random_bytes(12, 18, 4)
    pixels[..., 3] = 255
    found = load(tmp_path, pixels, 9)
    assert found.alpha is None and found.color.shape == (6, 9, 3)


def test_undistorted_photos_say_which_pixels_they_cover(tmp_path):
    found = load(tmp_path, random_bytes(12, 18, 3), 9, distortion=(0.5, 0.0, 0.0, 0.0))
    assert found.camera.distortion == ()
    assert found.valid.shape == (6, 9) and found.valid[3, 4] and not found.valid[0, 0]


def test_a_shrunken_photo_is_undistorted_without_loss_of_detail(tmp_path):
    camera = Camera(640, 480, 420.0, 410.0, 332.0, 230.0, np.eye(4), (0.12, 0.05, 0.011, -0.0095))
    smooth = cv2.GaussianBlur(np.random.default_rng(10).random((480, 640, 3)), (0, 0), 4)
    pixels = np.uint8(255 * (smooth - smooth.min()) / np.ptp(smooth))
    write_png(tmp_path / "a.png", pixels)
    (found,) = load_views([View("a", "a", camera, tmp_path / "a.png", "train")], 100)
    straight, _, valid = undistort(pixels / 255, camera)
    seen = resize(valid.astype(float), 100, 75) > 0.999
    difference = np.abs(found.color - resize(straight, 100, 75))[seen & found.valid]
    assert difference.max() < 0.03 and np.sqrt((difference**2).mean()) < 0.004
    assert (seen != found.valid).mean() < 0.02


def test_a_lens_map_is_computed_once_for_views_that_share_it(tmp_path):
    lens_map.cache_clear()
    lens = [view_of(tmp_path / f"{i}.png", random_bytes(12, 18, 3), LENS) for i in range(3)]
    other = [view_of(tmp_path / f"b{i}.png", random_bytes(12, 18, 3), LENS[:4]) for i in range(3)]
    load_views([view for pair in zip(lens, other, strict=True) for view in pair], 9)
    assert lens_map.cache_info().misses == 2


@pytest.mark.parametrize(("size", "turn"), [((16, 32), 3), ((32, 16), 0)])
def test_turned_photos_are_loaded_as_their_camera_was_made(tmp_path, size, turn):
    pixels = np.zeros((16, 32, 3), np.uint8)
    pixels[:8, :8] = 255
    exif = Image.Exif()
    exif[0x0112] = 6
    path = tmp_path / "a.jpg"
    Image.fromarray(pixels).save(path, exif=exif, quality=100)
    camera = Camera(*size, 20.0, 20.0, size[0] / 2, size[1] / 2, np.eye(4))
    (found,) = load_views([View("a", "a", camera, path, "train")], 100)
    assert_allclose(found.color, np.rot90(pixels / 255, turn), atol=0.05)


def test_photos_that_do_not_fit_their_camera_are_named(tmp_path):
    with pytest.raises(DataError, match=r"a\.png is 18x12 pixels where its camera has 20x12"):
        load(tmp_path, random_bytes(12, 18, 3), 9, size=(20, 12))


def test_photos_of_many_sizes_and_kinds_load_in_one_capture(tmp_path):
    OpenEXR.File({}, {"RGB": np.full((8, 24, 3), 0.18, np.float32)}).write(str(tmp_path / "d.exr"))
    views = [
        view_of(tmp_path / "a.png", random_bytes(12, 18, 3)),
        view_of(tmp_path / "b.png", random_bytes(30, 20, 4)),
        view_of(tmp_path / "c.png", random_bytes(6, 4, 3), LENS),
        View("d", "d", Camera(24, 8, 20.0, 20.0, 12.0, 4.0, np.eye(4)), tmp_path / "d.exr", "test"),
    ]
    found = load_views(views, 12)
    sizes = [each.color.shape[1::-1] for each in found]
    assert sizes == [(each.camera.width, each.camera.height) for each in found] == [(12, 8), (8, 12), (4, 6), (12, 4)]
    assert [each.alpha is not None for each in found] == [False, True, False, False]
    assert_allclose(found[3].color, linear_to_srgb(np.float64(0.18)), atol=1e-6)


def test_no_more_than_one_full_size_photo_is_held(tmp_path, monkeypatch):
    alive, read = [], training_images.read_photo

    def read_alone(path, *how):
        gc.collect()
        assert not any(reference() is not None for reference in alive)
        photo = read(path, *how)
        alive.append(weakref.ref(photo))
        return photo

    monkeypatch.setattr(training_images, "read_photo", read_alone)
    load_views([view_of(tmp_path / f"{i}.png", random_bytes(12, 18, 3), LENS) for i in range(3)], 9)
    assert len(alive) == 3


def test_each_kind_of_background_is_recognized():
    photo = np.random.default_rng(4).uniform(0.2, 0.8, size=(20, 30, 3))
    black, white, matte = photo.copy(), photo.copy(), np.dstack([photo, np.ones((20, 30))])
    for image, color in ((black, 0.01), (white, 0.99)):
        image[:2], image[-2:], image[:, :2], image[:, -2:] = color, color, color, color
        image[0, 10:20] = 0.5  # the object touches the border
    matte[:5, :, 3] = 0
    opaque = np.dstack([black, np.ones((20, 30))])
    cases = {"opaque": ([photo] * 3, [black] * 2 + [photo]), "white": ([white] * 3,), "alpha": ([matte] * 3,),
             "black": ([black] * 3, [opaque] * 3, [black] * 9 + [photo])}  # fmt: skip
    assert {kind: {background_kind(photos) for photos in rows} for kind, rows in cases.items()} == {
        kind: {kind} for kind in cases
    }


def test_photos_without_any_visible_pixel_are_no_scene():
    hidden, seen = np.zeros((4, 4, 4), np.float32), np.full((4, 4, 4), 0.5, np.float32)
    with pytest.raises(DataError, match="All photos are transparent everywhere") as caught:
        background_kind([hidden] * 3)
    assert caught.value.hint
    assert background_kind([hidden, seen]) == "alpha"
