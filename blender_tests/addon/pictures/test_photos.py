"""Photos behind cameras match the pinhole, while masks are painted on the stored photo."""

from dataclasses import replace

import numpy as np
import pytest

WIDTH, HEIGHT = 120, 90
LENS = (-0.3, 0.08, 0.002, -0.003)


@pytest.fixture
def bent(addon, tmp_path):
    """A capture with one distorted photo of white dots, and the dots' pixels in the undistorted one."""
    api = addon.engine_api
    camera = api.Camera(WIDTH, HEIGHT, 80.0, 84.0, 57.0, 48.0, np.eye(4), LENS)
    pixels = np.array([[15.5, 12.5], [60.5, 45.5], [104.5, 20.5], [100.5, 80.5]])
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    photo = np.zeros((HEIGHT, WIDTH, 3))
    for spot in api.distort(camera, pixels):
        photo += np.exp(-((u - spot[0]) ** 2 + (v - spot[1]) ** 2) / 2)[..., None]
    addon.images.write_png(tmp_path / "bent" / "images" / "a.png", np.minimum(photo, 1))
    api.write_cameras(tmp_path / "bent" / "transforms.json", [api.View("images/a.png", "a", camera, None, "train")])
    return tmp_path / "bent", pixels


def background(bpy, scene):
    (only,) = scene.camera.data.background_images
    return bpy.path.abspath(only.image.filepath)


@pytest.mark.parametrize("part", [1, 2])
def test_distorted_photo_is_undistorted_except_for_painting(bpy, addon, scene, bent, tmp_path, monkeypatch, part):
    if part > 1:
        monkeypatch.setattr(addon.photos, "MOST_PIXELS", WIDTH * HEIGHT // part**2, raising=False)
    folder, pixels = bent
    addon.steps.import_capture(scene, folder, tmp_path / "project")
    shown = addon.images.read_picture(background(bpy, scene))
    assert shown.shape == (HEIGHT // part, WIDTH // part, 3)
    for column, row in (pixels / part).astype(int):
        around = shown[row - 2 : row + 3, column - 2 : column + 3, 0]
        assert np.abs(np.subtract(np.unravel_index(around.argmax(), around.shape), 2)).max() <= part - 1
    photo = addon.steps.show_photo(scene)
    assert tuple(photo.size) == (WIDTH, HEIGHT) and photo.filepath == str(folder / "images" / "a.png")


def test_undistorted_photo_is_made_once_and_only_if_wanted(bpy, addon, scene, bent, tmp_path):
    addon.steps.import_capture(scene, bent[0], tmp_path / "project")
    (made,) = addon.folders.project_of(scene).photos_folder.iterdir()
    written = made.stat().st_mtime_ns
    addon.steps.look_through(scene)
    addon.steps.import_capture(scene, bent[0], tmp_path / "project")
    assert background(bpy, scene) == str(made) and made.stat().st_mtime_ns == written
    assert len(scene.camera.data.background_images) == 1
    addon.steps.import_capture(scene, bent[0], tmp_path / "project", rig=addon.steps.RigOptions(photos=False))
    assert not scene.camera.data.background_images


def test_damaged_photo_warns_and_keeps_the_rig(addon, scene, bent, tmp_path):
    photo = bent[0] / "images" / "a.png"
    photo.write_bytes(photo.read_bytes()[:60])
    capture = addon.steps.import_capture(scene, bent[0], tmp_path / "project")
    assert "a.png" in capture.warnings[-1] and len(scene.karf.rig.children) == 1


@pytest.fixture
def read(addon, monkeypatch, tmp_path):
    """Returns a view of a stored photo [H, W, 3] with a changed header, and its pixels as read."""

    def read(stored, height, width, **header):
        api, file = addon.engine_api, tmp_path / "photo.png"
        addon.images.write_png(file, stored)
        camera = api.Camera(width, height, 5.0, 5.0, width / 2, height / 2, np.eye(4))
        told = replace(api.find_header(file), **header)
        monkeypatch.setattr(addon.photos, "find_header", lambda path: told)
        view = api.View("photo", "photo", camera, file, "train")
        return view, addon.photos.read(view)

    return read


@pytest.mark.parametrize("orientation", range(1, 9))
def test_rotated_photo_is_read_upright(addon, read, orientation, tmp_path):
    """The letter F, which looks different in all eight orientations (Exif 2.3, table of tag 0x0112)."""
    upright = np.array([[1, 1, 1], [1, 0, 0], [1, 1, 0], [1, 0, 0]], float)[..., None].repeat(3, axis=2)
    stored = {
        1: upright,
        2: upright[:, ::-1],
        3: upright[::-1, ::-1],
        4: upright[::-1],
        5: upright.swapaxes(0, 1),
        6: np.rot90(upright, 1),  # a quarter turn to the right shows it upright
        7: np.rot90(upright, 2).swapaxes(0, 1),
        8: np.rot90(upright, -1),
    }[orientation]
    view, found = read(stored, 4, 3, orientation=orientation)
    np.testing.assert_array_equal(found, upright)
    shown = addon.photos.taken(view, tmp_path / "photos")
    np.testing.assert_array_equal(addon.images.read_picture(shown), upright)
    assert (shown == view.image) == addon.photos.is_shown_as_stored(view) == (orientation == 1)


def test_linear_photo_is_converted_to_srgb(addon, read):
    linear = np.linspace(0, 1, 12).reshape(2, 2, 3)
    _, found = read(linear, 2, 2, kind="exr")
    np.testing.assert_allclose(found, addon.engine_api.linear_to_srgb(linear), atol=0.03)
