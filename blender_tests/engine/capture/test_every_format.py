"""Every capture format gives the same cameras; precedence among formats, LLFF, and registered formats."""

import csv
import shutil
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from blender_tests.engine.capture.example_format import CSV
from blender_tests.engine.reference.capture_files import (
    centered,
    llff_table,
    put,
    put_photos,
    random_rig,
    write_colmap,
    write_llff,
    write_nerf_synthetic,
    write_transforms,
)
from karf_engine import capture as captures
from karf_engine.capture import open_capture, register_format
from karf_engine.capture.capture import Capture, CapturedSplats, View, capture_from_json, capture_to_json, with_gains
from karf_engine.errors import BadRequest, DataError

NAMES = [f"{number:03d}.png" for number in range(9)]
LENSES = {
    "pinhole": ((), False),
    "opencv": ((0.1, -0.02, 0.003, -0.004), False),
    "k3": ((0.1, -0.02, 0.003, -0.004, 0.005), False),
    "rational": ((0.1, -0.02, 0.003, -0.004, 0.005, 0.03, -0.01, 0.002), False),
    "fisheye": ((0.1, -0.02, 0.003, -0.004), True),
}
FORMATS = {  # writer, and the part of a camera that the format can express
    "nerf-synthetic": (lambda folder, cameras: write_nerf_synthetic(folder, cameras), centered),
    "transforms": (lambda folder, cameras: write_transforms(folder, cameras, NAMES), lambda camera: camera),
    "colmap binary": (lambda folder, cameras: write_colmap(folder, cameras, NAMES), lambda camera: camera),
    "colmap text": (lambda folder, cameras: write_colmap(folder, cameras, NAMES, ".txt"), lambda camera: camera),
    "llff": (lambda folder, cameras: write_llff(folder, cameras, NAMES), centered),
    "llff of nex": (lambda folder, cameras: write_llff(folder, cameras, NAMES, 14), lambda c: c.without_distortion()),
}


def assert_same_camera(read, written):
    assert (read.width, read.height, read.fisheye) == (written.width, written.height, written.fisheye)
    assert_allclose(*([camera.fx, camera.fy, camera.cx, camera.cy] for camera in (read, written)), rtol=1e-5)
    assert_allclose(read.distortion, written.distortion, rtol=1e-5)
    scale = 1 + np.abs(written.position).max()
    assert_allclose(read.camera_to_world, written.camera_to_world, rtol=1e-5, atol=1e-5 * scale)


@pytest.mark.opens(
    "capture",
    "NeRF's Blender script and data sets like it",
    "`transforms_train.json`, `_val`, `_test`",
    "splits; one field of view",
)
@pytest.mark.opens("capture", "instant-ngp, nerfstudio 1.1", "`transforms.json`", "all OpenCV lenses, masks, points")
@pytest.mark.opens("capture", "LLFF", "`poses_bounds.npy`", "photos in the order of the poses")
@pytest.mark.opens("capture", "NeX", "`poses_bounds.npy`, `hwf_cxcy.npy`", "photos in the order of the poses")
@pytest.mark.parametrize("name", FORMATS)
@settings(derandomize=True, max_examples=6, deadline=None)
@given(seed=st.integers(0, 10_000), lens=st.sampled_from(sorted(LENSES)))
def test_every_format_gives_the_same_cameras(tmp_path_factory, name, seed, lens):
    write, expressible = FORMATS[name]
    folder = tmp_path_factory.mktemp("rig")
    cameras = [expressible(camera) for camera in random_rig(seed, 9, *LENSES[lens])]
    write(folder, cameras)
    capture = open_capture(folder)
    assert capture.format == name.split()[0]
    assert capture.warnings == ()
    ordered = cameras[2:] + cameras[:2] if name == "nerf-synthetic" else cameras  # train, val, test
    for view, camera in zip(capture.views, ordered, strict=True):
        assert_same_camera(view.camera, camera)
        assert view.image.is_file()


RIG = [centered(camera) for camera in random_rig(3)]
WITH_SIZES = [name for name in FORMATS if name != "nerf-synthetic"]  # formats that declare the size of photos


@pytest.mark.parametrize("name", WITH_SIZES)
def test_intrinsics_and_observations_follow_the_actual_photo_size(tmp_path, name):
    write, expressible = FORMATS[name]
    write(tmp_path, [expressible(camera) for camera in random_rig(2)])
    before = open_capture(tmp_path)
    width, height = before.views[0].camera.width, before.views[0].camera.height
    put_photos(tmp_path / "images", NAMES, (2 * width, 3 * height))
    after = open_capture(tmp_path)
    for one, other in zip(before.views, after.views, strict=True):
        declared, scaled = ([c.width, c.height, c.fx, c.fy, c.cx, c.cy] for c in (one.camera, other.camera))
        assert_allclose(scaled, np.multiply([2, 3] * 3, declared))
        assert other.camera.distortion == one.camera.distortion
    assert f"{2 * width}x{3 * height} where" in after.warnings[0] and "scaled" in after.warnings[0]
    if after.points is not None:
        assert_allclose(after.points.pixels, before.points.pixels * (2, 3), rtol=1e-6)


@pytest.mark.parametrize("name", WITH_SIZES)
def test_cameras_can_be_read_without_photos(tmp_path, name):
    write, expressible = FORMATS[name]
    cameras = [expressible(camera) for camera in random_rig(2)]
    write(tmp_path, cameras)
    shutil.rmtree(tmp_path / "images")
    views = open_capture(tmp_path, photos=False).views
    assert [(view.name, view.image) for view in views] == [(f"{number:03d}", None) for number in range(9)]
    for view, camera in zip(views, cameras, strict=True):
        assert_same_camera(view.camera, camera)


@pytest.mark.parametrize("lens", LENSES)
def test_canonical_json_keeps_lenses_and_splats_when_moved(tmp_path, lens):
    then, now = tmp_path / "then", tmp_path / "now"
    splats = CapturedSplats(put(then / "splat.ply", b"ply"), True)
    cameras = random_rig(5, 3, *LENSES[lens])
    views = [View(f"v{i}", f"v{i}", camera, None, "train", (0.5, 8.0)) for i, camera in enumerate(cameras)]
    capture = Capture(then, "colmap", tuple(views), ("a remark",), splats=splats)
    capture = with_gains(capture, {"v1": (1.25, 1.0, 0.75)})
    assert [view.gains for view in capture.views] == [(1, 1, 1), (1.25, 1.0, 0.75), (1, 1, 1)]
    content = capture_to_json(capture, then / "project")
    then.rename(now)
    again = capture_from_json(content, now / "project" / "capture.json")
    assert again.splats == CapturedSplats(now / "splat.ply", True) and again.warnings == ("a remark",)
    for before, after in zip(capture.views, again.views, strict=True):
        assert replace(after, camera=before.camera) == before
        assert_array_equal(after.camera.camera_to_world, before.camera.camera_to_world)
        assert replace(after.camera, camera_to_world=np.eye(4)) == replace(before.camera, camera_to_world=np.eye(4))


def test_captures_with_splats_have_a_newer_schema(tmp_path):
    """Older engines would ignore the splats, so they must not accept such a capture."""
    bare = Capture(tmp_path, "transforms", (View("v", "v", RIG[0], tmp_path / "v.png", "train"),))
    assert capture_to_json(bare)["schema"] == "karf-capture/1" and "gains" not in capture_to_json(bare)["views"][0]
    with_splats = capture_to_json(replace(bare, splats=CapturedSplats(tmp_path / "splat.ply")))
    assert with_splats["schema"] == "karf-capture/2"
    early = capture_from_json(with_splats | {"schema": "karf-capture/1"}, tmp_path / "capture.json")
    assert early.splats is not None, "files written before the schema changed are read"


@pytest.fixture
def restore_formats(monkeypatch):
    """Restore the registered formats after the test."""
    monkeypatch.setattr(captures, "FORMATS", list(captures.FORMATS))


def write_all(folder, *formats):
    for name in formats:
        FORMATS[name][0](folder, [centered(camera) for camera in random_rig(2)])


@pytest.mark.parametrize(
    ("formats", "marker", "ignored"),
    [
        (["colmap binary", "llff"], "sparse/", "poses_bounds.npy"),
        (["transforms", "colmap binary"], "transforms.json", "sparse/"),
        (["transforms", "colmap text", "llff"], "transforms.json", "sparse/ or poses_bounds.npy"),
        (["nerf-synthetic", "transforms"], "transforms_train.json", "transforms.json"),
    ],
)
def test_first_of_several_formats_is_read_with_a_warning(tmp_path, formats, marker, ignored):
    write_all(tmp_path, *formats)
    capture = open_capture(tmp_path)
    assert capture.format == formats[0].split()[0]
    assert len(capture.warnings) == 1 and capture.warnings[0].startswith(f"{marker} was read, not {ignored}: ")


@pytest.mark.parametrize(
    ("file", "format_name"),
    {
        "transforms.json": "transforms",
        "sparse/0/images.bin": "colmap",
        "sparse": "colmap",
        "poses_bounds.npy": "llff",
    }.items(),
)
def test_chosen_file_determines_the_format(tmp_path, file, format_name):
    write_all(tmp_path, "transforms", "colmap binary", "llff")
    capture = open_capture(tmp_path / file)
    assert capture.format == format_name and capture.warnings == ()


def test_lookalike_of_a_model_does_not_hide_other_cameras(tmp_path):
    write_all(tmp_path, "llff")
    (tmp_path / "sparse").mkdir()
    put(tmp_path / "images.txt", b"a list of pictures")
    assert open_capture(tmp_path).format == "llff"


def test_photos_alone_are_rejected_naming_the_known_formats(restore_formats, tmp_path):
    put_photos(tmp_path / "images", NAMES)
    with pytest.raises(DataError, match="does not exist"):
        open_capture(tmp_path / "nothing")
    with pytest.raises(DataError, match="not a capture of a known format") as caught:
        open_capture(tmp_path)
    assert caught.value.hint == (
        "A capture has one of these: reconstruction.json, keyframes/, metadata and rgb/, transforms_train.json, "
        "transforms.json, sparse/, cameras.xml, cameras.csv or .xmp files, poses_bounds.npy."
    )
    register_format(CSV)
    with pytest.raises(DataError) as caught:
        open_capture(tmp_path)
    assert caught.value.hint.startswith("A capture has one of these: cameras.csv, reconstruction.json")


@pytest.fixture
def llff(tmp_path):
    write_llff(tmp_path, RIG, NAMES)
    return tmp_path


def test_llff_columns_are_down_right_back(tmp_path):
    #        down  right  back  position  (height, width, focal)
    block = [[0.0, 1.0, 0.0, 5.0, 6.0], [-1.0, 0.0, 0.0, 6.0, 8.0], [0.0, 0.0, 1.0, 7.0, 10.0]]
    np.save(tmp_path / "poses_bounds.npy", [[*np.ravel(block), 2.0, 30.0]])
    put_photos(tmp_path / "images", ["a.png"], (8, 6))
    view = open_capture(tmp_path).views[0]
    assert_allclose(view.camera.camera_to_world, [[1, 0, 0, 5], [0, 1, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]])
    assert (view.camera.width, view.camera.height, view.camera.fx, view.camera.cx, view.camera.cy) == (8, 6, 10, 4, 3)
    assert view.depth_bounds == (2, 30)


@pytest.mark.parametrize("chosen", ["poses_bounds.npy", "."])
def test_llff_trains_on_all_views_and_ignores_other_files(llff, chosen):
    put(llff / "images" / "._IMG_0.png", b"resource fork")
    put(llff / "images" / "notes.txt", b"text")
    capture = open_capture(llff / chosen)
    assert capture.format == "llff" and capture.warnings == ()
    assert [view.image for view in capture.split("train")] == [llff / "images" / name for name in NAMES]


def test_llff_uses_the_largest_complete_photos(llff):
    (llff / "images" / NAMES[4]).unlink()
    for name, size in (("images_2", (40, 30)), ("images_4", (20, 15)), ("images_20x15", (20, 16))):
        put_photos(llff / name, NAMES, size)
    assert {view.image.parent.name for view in open_capture(llff).views} == {"images_2"}


def test_llff_drops_impossible_depth_bounds_with_a_warning(llff):
    np.save(llff / "poses_bounds.npy", llff_table(RIG, bounds=(-1.0, 5.0)))
    capture = open_capture(llff)
    assert all(view.depth_bounds is None for view in capture.views)
    assert capture.warnings == ("9 views: depth bounds that are not a range of positive depths were left out.",)


def write_csv(folder):
    put_photos(folder / "images", NAMES, RIG)
    with (folder / "cameras.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["photo", "width", "height", "focal", "camera_to_world"])
        for name, camera in zip(NAMES, RIG, strict=True):
            pose = " ".join(map(repr, camera.camera_to_world.ravel().tolist()))
            writer.writerow([f"images/{name}", camera.width, camera.height, camera.fx, pose])


@pytest.mark.parametrize("place", [".", "cameras.csv"])
def test_registered_format_takes_precedence(restore_formats, tmp_path, place):
    register_format(CSV)
    write_csv(tmp_path)
    capture = open_capture(tmp_path / place, holdout=8)
    assert (capture.format, capture.warnings) == ("csv", ())
    assert [view.split for view in capture.views] == ["test", *["train"] * 7, "test"]
    for view, camera, name in zip(capture.views, RIG, NAMES, strict=True):
        assert view.image == (tmp_path / "images" / name).absolute()
        assert_same_camera(view.camera, camera)
    write_llff(tmp_path, RIG, NAMES)
    assert open_capture(tmp_path).warnings == ("cameras.csv was read, not poses_bounds.npy: it was written by hand.",)


def test_format_name_is_registered_once(restore_formats):
    register_format(CSV)
    register_format(CSV)  # as when a module is imported twice
    with pytest.raises(BadRequest, match="another capture format 'csv'"):
        register_format(replace(CSV, marker="other.csv"))
    assert [known.name for known in captures.FORMATS].count("csv") == 1
