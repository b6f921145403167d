"""A format that is not the engine's own: registered once, it is opened like any other."""

import csv
from dataclasses import replace

import pytest
from numpy.testing import assert_allclose

from blender_tests.engine.capture.example_format import CSV
from blender_tests.engine.reference.capture_files import centered, put_photos, random_rig, write_llff
from karf_engine import capture as captures
from karf_engine.capture import open_capture, register_format
from karf_engine.errors import BadRequest, DataError

NAMES = [f"{number:03d}.png" for number in range(9)]
CAMERAS = [centered(camera) for camera in random_rig(3)]


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    monkeypatch.setattr(captures, "FORMATS", list(captures.FORMATS))
    register_format(CSV)


def write_csv(folder):
    put_photos(folder / "images", NAMES, CAMERAS)
    with (folder / "cameras.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["photo", "width", "height", "focal", "camera_to_world"])
        for name, camera in zip(NAMES, CAMERAS, strict=True):
            pose = " ".join(map(repr, camera.camera_to_world.ravel().tolist()))
            writer.writerow([f"images/{name}", camera.width, camera.height, camera.fx, pose])


@pytest.mark.parametrize("place", [".", "cameras.csv"])
def test_a_registered_format_is_opened_by_its_folder_or_its_file(tmp_path, place):
    write_csv(tmp_path)
    capture = open_capture(tmp_path / place)
    assert (capture.format, capture.warnings) == ("csv", ())
    held_out = open_capture(tmp_path / place, holdout=8).split("test")
    assert [view.name for view in held_out] == [capture.views[0].name, capture.views[8].name]
    assert [view.image for view in open_capture(tmp_path, photos=False).views] == [None] * 9
    for view, camera, name in zip(capture.views, CAMERAS, NAMES, strict=True):
        assert view.image == (tmp_path / "images" / name).absolute()
        assert (view.camera.width, view.camera.height, view.camera.fx) == (camera.width, camera.height, camera.fx)
        assert_allclose(view.camera.camera_to_world, camera.camera_to_world, rtol=1e-12)


def test_it_is_read_before_the_formats_that_were_known(tmp_path):
    write_llff(tmp_path, CAMERAS, NAMES)
    write_csv(tmp_path)
    assert open_capture(tmp_path).warnings == ("cameras.csv was read, not poses_bounds.npy: it was written by hand.",)


def test_its_marker_is_named_where_no_format_is_found(tmp_path):
    with pytest.raises(DataError) as caught:
        open_capture(tmp_path)
    assert caught.value.hint.startswith("A capture has one of these: cameras.csv, transforms_train.json")


def test_a_name_is_registered_once():
    register_format(CSV)  # again, as a module that is imported twice does
    with pytest.raises(BadRequest, match="another capture format 'csv'"):
        register_format(replace(CSV, marker="other.csv"))
    assert [known.name for known in captures.FORMATS].count("csv") == 1
