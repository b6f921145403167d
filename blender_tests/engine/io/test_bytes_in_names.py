"""Every kind of file works in folders whose names are not UTF-8 (as Linux allows), or an error says why not."""

import os
from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import pytest
import torch

from blender_tests.engine.splats.clouds import cloud
from blender_tests.engine.splats.formats.files import ENDS
from karf_engine.capture.structure_from_motion import write_sharpest_frames
from karf_engine.errors import KarfError
from karf_engine.export.frame_files import write_frame
from karf_engine.io.checkpoints import load_tensors, save_tensors
from karf_engine.io.color_spaces import color_space
from karf_engine.io.failures import translate_errors
from karf_engine.io.files import library_path, read_json, write_json
from karf_engine.io.images import read_photo, write_png
from karf_engine.splats.formats.registry import read_splats, write_splats
from karf_engine.splats.formats.splat_file import SplatFile

ODD = os.fsdecode(b"caf\xe9")  # Latin-1, as on an old disk
COLOR = np.full((8, 8, 3), 0.5, np.float32)


@pytest.fixture
def folder(tmp_path):
    made = tmp_path / ODD
    try:
        made.mkdir()
    except OSError:
        pytest.skip("file names are Unicode on this system")
    return made


def tensors(path):
    save_tensors(path, {"a": torch.ones(3)}, "test 1", {"of": "a test"})
    loaded, facts = load_tensors(path, "test 1")
    assert loaded["a"].tolist() == [1, 1, 1] and facts == {"of": "a test"}


def json(path):
    write_json(path, {"photo": str(path)})
    assert read_json(path, "test") == {"photo": str(path)}


def picture(path):
    write_png(path, np.uint8(COLOR * 255))
    assert read_photo(path).shape == (8, 8, 3)


def frame(path):
    write_frame(path, COLOR, "exr32")
    with library_path(path) as readable:
        assert OpenEXR.File(readable).channels()["RGB"].pixels.shape == (8, 8, 3)
    assert read_photo(path).shape == (8, 8, 3)


def film(path):
    plain = path.parents[1] / "film.mp4"
    writer = cv2.VideoWriter(str(plain), cv2.VideoWriter.fourcc(*"mp4v"), 25, (64, 64))
    for number in range(4):
        writer.write(np.full((64, 64, 3), number, np.uint8))
    writer.release()
    plain.rename(path)
    (path.parent / "frames").mkdir()
    assert write_sharpest_frames(path, path.parent / "frames", lambda: False)


def gaussians(path):
    write_splats(path, SplatFile(cloud(9)))
    assert len(read_splats(path).table) == 9


def file_with_odd_name(path):
    path = path.with_name(ODD)
    path.write_bytes(b"content")
    with library_path(path) as readable:
        assert Path(readable).read_bytes() == b"content"


ROUND_TRIPS = [(tensors, "scene.safetensors"), (json, "edit.json"), (picture, "photo.png"), (frame, "frame.exr")]
ROUND_TRIPS += [(film, "film.mp4"), (file_with_odd_name, "any")]
ROUND_TRIPS += [(gaussians, f"cloud{end}") for end in ENDS if not end.startswith(".usd")]


@pytest.mark.parametrize(("round_trip", "name"), ROUND_TRIPS)
def test_file_in_non_utf8_folder_is_written_and_read(folder, round_trip, name):
    round_trip(folder / name)


def usd(path):
    pytest.importorskip("pxr")
    write_splats(path, SplatFile(cloud(9)))


def configuration(path):
    pytest.importorskip("PyOpenColorIO")
    path.write_text("ocio_profile_version: 2\n")
    color_space("ACEScg", str(path))


@pytest.mark.parametrize(("work", "name"), [(usd, "a.usda"), (usd, "a.usdc"), (configuration, "config.ocio")])
def test_unicode_only_library_error_names_the_path_and_a_remedy(folder, work, name):
    with pytest.raises(KarfError, match=r"caf.*not UTF-8.*Rename that file or folder"), translate_errors():
        work(folder / name)
