"""Photos at the working size with their cameras, and what surrounds the objects in them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

pytest.importorskip("cv2")
pytest.importorskip("scipy")
pytest.importorskip("imageio.v3")
Image = pytest.importorskip("PIL.Image")
OpenEXR = pytest.importorskip("OpenEXR")

from blender_tests.engine.reference.pictures import LENS, random_bytes, view_of
from karf_engine.capture import training_images
from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import View
from karf_engine.capture.training_images import background_kind, load_views
from karf_engine.errors import DataError
from karf_engine.io.color import linear_to_srgb

# ------------------------------------------------------------------------------------------------------- training images


def test_training_images_shrink_to_the_long_side_with_their_camera(tmp_path):
    pixels = random_bytes(12, 18, 3)
    (training_image,) = load_views([view_of(tmp_path / "a.png", pixels)], 9)
    assert training_image.color.shape == (6, 9, 3) and training_image.color.dtype == np.float32
    assert_allclose(training_image.color, pixels.reshape(6, 2, 9, 2, 3).mean((1, 3)) / 255, atol=1e-6)
    camera = training_image.camera
    assert (camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy) == (9, 6, 10, 11, 4.5, 3)
    assert training_image.alpha is None and training_image.valid is None


def test_training_images_are_never_enlarged_and_then_keep_every_stored_color(tmp_path):
    pixels = random_bytes(12, 18, 4)
    (training_image,) = load_views([view_of(tmp_path / "a.png", pixels)], 400)
    assert_array_equal(training_image.color, pixels[..., :3].astype(np.float32) / 255)
    assert_array_equal(training_image.alpha, pixels[..., 3].astype(np.float32) / 255)


def test_hidden_colors_do_not_bleed_into_shrunken_plates(tmp_path):
    pixels = np.zeros((2, 4, 4), np.uint8)
    pixels[:, 0] = [255, 51, 0, 255]  # orange and opaque beside green and fully transparent
    pixels[:, 1:] = [0, 255, 0, 0]
    (training_image,) = load_views([view_of(tmp_path / "a.png", pixels)], 2)
    assert_allclose(training_image.alpha, [[0.5, 0.0]])
    assert_allclose(training_image.color[0, 0], [1.0, 0.2, 0.0], atol=1e-6)


def test_an_alpha_of_255_everywhere_is_no_matte(tmp_path):
    pixels = random_bytes(12, 18, 4)
    pixels[..., 3] = 255
    (training_image,) = load_views([view_of(tmp_path / "a.png", pixels)], 9)
    assert training_image.alpha is None and training_image.color.shape == (6, 9, 3)


def test_undistorted_plates_say_which_pixels_the_photo_covers(tmp_path):
    view = view_of(tmp_path / "a.png", random_bytes(12, 18, 3), distortion=(0.5, 0.0, 0.0, 0.0))
    (training_image,) = load_views([view], 9)
    assert training_image.camera.distortion == ()
    assert training_image.valid.shape == (6, 9) and training_image.valid[3, 4] and not training_image.valid[0, 0]


@pytest.mark.parametrize(("size", "turn"), [((16, 32), 3), ((32, 16), 0)])
def test_turned_photos_are_loaded_as_their_camera_was_made(tmp_path, size, turn):
    pixels = np.zeros((16, 32, 3), np.uint8)
    pixels[:8, :8] = 255
    exif = Image.Exif()
    exif[0x0112] = 6
    path = tmp_path / "a.jpg"
    Image.fromarray(pixels).save(path, exif=exif, quality=100)
    camera = Camera(*size, 20.0, 20.0, size[0] / 2, size[1] / 2, np.eye(4))
    (training_image,) = load_views([View("a", "a", camera, path, "train")], 100)
    assert_allclose(training_image.color, np.rot90(pixels / 255, turn), atol=0.05)


def test_photos_that_do_not_fit_their_camera_are_named(tmp_path):
    view = view_of(tmp_path / "a.png", random_bytes(12, 18, 3), size=(20, 12))
    with pytest.raises(DataError, match=r"a\.png is 18x12 pixels where its camera has 20x12"):
        load_views([view], 9)


def test_photos_of_many_sizes_and_kinds_load_in_one_capture(tmp_path):
    views = [
        view_of(tmp_path / "a.png", random_bytes(12, 18, 3)),
        view_of(tmp_path / "b.png", random_bytes(30, 20, 4)),
        view_of(tmp_path / "c.png", random_bytes(6, 4, 3), LENS),
    ]
    light = np.full((8, 24, 3), 0.18, np.float32)
    OpenEXR.File({}, {"RGB": light}).write(str(tmp_path / "d.exr"))
    views.append(View("d", "d", Camera(24, 8, 20.0, 20.0, 12.0, 4.0, np.eye(4)), tmp_path / "d.exr", "test"))
    training_images = load_views(views, 12)
    assert [training_image.color.shape[1::-1] for training_image in training_images] == [
        (12, 8),
        (8, 12),
        (4, 6),
        (12, 4),
    ]
    for training_image in training_images:
        assert (training_image.camera.width, training_image.camera.height) == training_image.color.shape[1::-1]
    assert [training_image.alpha is not None for training_image in training_images] == [False, True, False, False]
    assert_allclose(training_images[3].color, linear_to_srgb(np.float64(0.18)), atol=1e-6)


def test_no_more_than_one_full_size_photo_is_held(tmp_path, monkeypatch):
    import gc
    import weakref

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


# ----------------------------------------------------------------------------------------------------------- background
def test_each_kind_of_background_is_recognized():
    photo = np.random.default_rng(4).uniform(0.2, 0.8, size=(20, 30, 3))
    black, white, matte = photo.copy(), photo.copy(), np.dstack([photo, np.ones((20, 30))])
    for image, color in ((black, 0.01), (white, 0.99)):
        image[:2], image[-2:], image[:, :2], image[:, -2:] = color, color, color, color
        image[0, 10:20] = 0.5  # the object touches the border
    matte[:5, :, 3] = 0
    opaque = np.dstack([black, np.ones((20, 30))])
    assert background_kind([photo] * 3) == "opaque"
    assert background_kind([black] * 3) == "black"
    assert background_kind([opaque] * 3) == "black"
    assert background_kind([white] * 3) == "white"
    assert background_kind([matte] * 3) == "alpha"
    assert background_kind([black] * 9 + [photo]) == "black"
    assert background_kind([black] * 2 + [photo]) == "opaque"
