"""Photos that Blender cannot read, or whose color profile it ignores, are shown right."""

import json
import os
import struct
import subprocess
import sys
import zlib

import numpy as np
import pytest

from ..conftest import make_capture

ENGINE_PYTHON = os.environ.get("KARF_ENGINE_PYTHON")
DISPLAY_P3 = np.array([[0.51512, 0.29198, 0.1571], [0.24120, 0.69225, 0.06657], [-0.00105, 0.04189, 0.78407]])
SRGB = np.array([[0.43607, 0.38515, 0.14307], [0.22249, 0.71687, 0.06061], [0.01392, 0.09708, 0.71410]])


def profile(matrix):
    """An ICC profile of primaries [3, 3] and the tone curve of sRGB."""
    curve = b"para\0\0\0\0\0\x03\0\0" + struct.pack(
        ">5i", *(round(v * 65536) for v in (2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045))
    )
    tags = {
        f"{c}XYZ": b"XYZ \0\0\0\0" + struct.pack(">3i", *np.rint(matrix[:, n] * 65536).astype(int))
        for n, c in enumerate("rgb")
    }
    tags |= {f"{c}TRC": curve for c in "rgb"}
    table, data = struct.pack(">I", len(tags)), b""
    for name, content in tags.items():
        table += struct.pack(">4sII", name.encode(), 132 + 12 * len(tags) + len(data), len(content))
        data += content
    head = bytearray(128)
    head[16:24] = b"RGB XYZ "
    return bytes(head) + table + data


def add_profile(path, icc):
    """Put an iCCP chunk behind the header of a PNG."""
    content = path.read_bytes()
    chunk = b"iCCP" + b"p\0\0" + zlib.compress(icc)
    packed = struct.pack(">I", len(chunk) - 4) + chunk + struct.pack(">I", zlib.crc32(chunk))
    path.write_bytes(content[:33] + packed + content[33:])


@pytest.mark.parametrize(("matrix", "is_converted"), [(DISPLAY_P3, True), (SRGB, False)])
def test_photo_with_a_profile_is_shown_in_srgb(bpy, addon, scene, capture_folder, tmp_path, matrix, is_converted):
    photo = capture_folder / "images" / "photo_0.png"
    stored = addon.images.read_picture(photo)
    add_profile(photo, profile(matrix))
    addon.steps.import_capture(scene, capture_folder, tmp_path / "project")
    (background,) = scene.camera.data.background_images
    shown = addon.images.read_picture(addon.folders.absolute(background.image.filepath))
    view = addon.captures.view_of(scene)
    linear = addon.engine_api.srgb_to_linear(stored) @ (np.linalg.inv(SRGB) @ matrix).T
    expected = addon.engine_api.linear_to_srgb(linear.clip(0, 1))
    np.testing.assert_allclose(shown, expected, atol=1.5 / 255)
    np.testing.assert_allclose(addon.photos.read(view), expected, atol=1.5 / 255)
    assert addon.photos.is_shown_as_stored(view) is not is_converted
    assert bool(np.abs(expected - stored).max() > 0.05) is is_converted


@pytest.fixture
def phone_capture(addon, scene, tmp_path):
    """A capture of 64 x 64 photos, the first of them as HEIC, written by the engine's Python."""
    scene.view_settings.view_transform = "Standard"  # needs no warning
    capture_folder = make_capture(addon, tmp_path / "phone", 3, 64, 64)
    folder = capture_folder / "images"
    script = (
        "import sys, pillow_heif; from PIL import Image; pillow_heif.register_heif_opener(); "
        "Image.open(sys.argv[1]).convert('RGB').save(sys.argv[2], quality=95)"
    )
    names = [str(folder / "photo_0.png"), str(folder / "photo_0.heic")]
    made = subprocess.run([ENGINE_PYTHON or sys.executable, "-c", script, *names], capture_output=True, text=True)
    if made.returncode:
        pytest.skip("the engine's Python has no pillow-heif")
    (folder / "photo_0.png").unlink()
    file = capture_folder / "transforms.json"
    content = json.loads(file.read_text())
    content["frames"][0]["file_path"] = "images/photo_0.heic"
    file.write_text(json.dumps(content))
    return capture_folder


def test_unreadable_photo_is_copied_once_by_the_engine(bpy, addon, scene, phone_capture, tmp_path):
    capture = addon.steps.import_capture(scene, phone_capture, tmp_path / "project")
    assert not capture.warnings
    (background,) = scene.camera.data.background_images
    assert addon.images.read_picture(addon.folders.absolute(background.image.filepath)).mean() == pytest.approx(
        0.5, abs=0.01
    )
    assert tuple(addon.steps.show_photo(scene).size) == (64, 64)  # to mark
    assert addon.views.placeholder(scene, addon.views.PictureFiles()).shape == (64, 64, 4)
    copies = sorted((tmp_path / "project" / "photos").iterdir())
    addon.steps.import_capture(scene, phone_capture)
    assert sorted((tmp_path / "project" / "photos").iterdir()) == copies


def test_import_without_an_engine_names_photos_that_are_not_shown(
    bpy, addon, scene, phone_capture, tmp_path, monkeypatch
):
    monkeypatch.delenv("KARF_ENGINE_PYTHON")
    monkeypatch.setattr(addon.engine_api, "ENGINE_FOLDER", tmp_path / "karf_engine")
    capture = addon.steps.import_capture(scene, phone_capture, tmp_path / "project")
    assert capture.warnings == (f"Blender cannot show {phone_capture}/images/photo_0.heic without the engine.",)
    assert len(scene.karf.views) == len([each for each in scene.karf.rig.children if each.type == "CAMERA"]) == 3
    assert not scene.camera.data.background_images
