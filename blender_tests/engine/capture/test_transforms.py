"""transforms*.json: exact round trips, and layouts that occur in practice."""

import io
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from blender_tests.engine.reference.capture_files import jpeg_head, png_bytes, put, put_json, random_rig
from karf_engine.capture import open_capture, write_cameras
from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import Capture, CapturedSplats, View
from karf_engine.capture.transforms import write_capture
from karf_engine.errors import BadRequest

POSE = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]]


def frames(*names, **fields):
    return [{"file_path": name, "transform_matrix": POSE, **fields} for name in names]


def write_captured(folder, file, names, size=(4, 4), **content):
    """Write a transforms file and the photos that it names."""
    put_json(folder / file, {"camera_angle_x": math.pi / 2, "frames": frames(*names)} | content)
    for name in names:
        put(folder / (name if name.endswith(".png") else f"{name}.png"), png_bytes(*size))


@pytest.fixture
def open_one(tmp_path):
    """Opens a transforms.json with this content and one photo a.png."""

    def write_and_open(content, size=(4, 4)):
        write_captured(tmp_path, "transforms.json", ["a.png"], size, **content)
        return open_capture(tmp_path)

    return write_and_open


def rig(seed: int) -> list[View]:
    """Five views with five lenses."""
    views = []
    for index, n_coefficients in enumerate((0, 4, 5, 8, 4)):
        coefficients = np.random.default_rng(seed + index).normal(size=n_coefficients) * 0.1
        (camera,) = random_rig(seed + index, 1, coefficients, index == 4)
        split = ("train", "val", "test")[seed % 3] if index == 0 else "train"
        views.append(View(f"frame.{index:04d}", f"frame.{index:04d}", camera, None, split))
    return views


def test_written_capture_is_read_back_with_photos_and_splats(tmp_path):
    """The folder is moved after writing, and one photo lies outside it."""
    work, out = tmp_path / "work", tmp_path / "deep" / "out"
    photos = [put(work / "images" / "a.png", png_bytes(8, 6)), put(tmp_path / "photos" / "b.png", png_bytes(8, 6))]
    camera = Camera(8, 6, 7.0, 7.5, 4.0, 3.0, np.array(POSE, float), (0.1, 0, 0, 0))
    views = tuple(View(p.stem, p.stem, camera, p, s) for p, s in zip(photos, ("train", "test"), strict=True))
    splats = CapturedSplats(put(work / "splat.ply", b"ply"), True)
    write_capture(work / "transforms.json", Capture(work, "transforms", views, splats=splats), out)
    out.parent.mkdir()
    work.rename(out)
    found = open_capture(out)
    assert [view.image.resolve() for view in found.views] == [out / "images" / "a.png", photos[1]]
    assert [view.split for view in found.views] == ["train", "test"]
    assert found.views[0].camera.distortion == camera.distortion
    assert found.splats == CapturedSplats(out / "splat.ply", True)


@settings(derandomize=True, max_examples=25, deadline=None)
@given(st.integers(0, 10_000))
def test_written_cameras_are_read_back_without_loss(tmp_path_factory, seed):
    path = tmp_path_factory.mktemp("rig") / "CAMERAS.json"
    views = rig(seed)
    write_cameras(path, views)
    put(path.with_name(f"{views[0].name}.png"), png_bytes(2, 2))
    capture = open_capture(path, photos=False)
    assert capture.warnings == ()
    for before, after in zip(views, capture.views, strict=True):
        assert replace(after, camera=before.camera) == before
        assert_allclose(after.camera.camera_to_world, before.camera.camera_to_world, rtol=0, atol=1e-9)
        assert replace(after.camera, camera_to_world=np.eye(4)) == replace(before.camera, camera_to_world=np.eye(4))


def test_nerf_synthetic_keeps_splits_and_makes_names_unique(tmp_path):
    for split, count in (("train", 3), ("val", 2), ("test", 2)):
        write_captured(tmp_path, f"transforms_{split}.json", [f"./{split}/r_{i}" for i in range(count)], (20, 10))
    capture = open_capture(tmp_path)
    assert capture.format == "nerf-synthetic"
    assert [(view.name, view.split) for view in capture.views] == [
        *(("train_r_0", "train"), ("train_r_1", "train"), ("r_2", "train")),
        *(("val_r_0", "val"), ("val_r_1", "val"), ("test_r_0", "test"), ("test_r_1", "test")),
    ]
    camera = capture.views[0].camera
    assert (camera.width, camera.height, camera.cx, camera.cy) == (20, 10, 10, 5)
    assert_allclose([camera.fx, camera.fy], 10)  # half the width for a field of view of 90 degrees
    assert capture.views[0].stem == "r_0"
    assert len(open_capture(tmp_path / "transforms_test.json").views) == 7  # a file stands for its folder


def test_split_file_without_photos_holds_only_its_own_cameras(tmp_path):
    for split in ("train", "test"):
        write_captured(tmp_path, f"transforms_{split}.json", [f"{split}/r_0"], w=4, h=4)
    bare = open_capture(tmp_path / "transforms_test.json", photos=False)
    assert [(view.name, view.split) for view in bare.views] == [("r_0", "test")]


def test_captures_without_test_views_hold_out_the_requested_share(tmp_path):
    write_captured(tmp_path, "transforms_train.json", [f"train/r_{i}" for i in range(9)])
    write_captured(tmp_path, "transforms_val.json", ["val/v"])
    capture = open_capture(tmp_path, holdout=8)
    assert [view.name for view in capture.split("test")] == ["r_0", "r_8"]
    assert [view.name for view in capture.split("val")] == ["v"]
    assert capture.holdout == 8
    assert open_capture(tmp_path).split("test") == open_capture(tmp_path, holdout=10).split("test") == ()


def test_nerfstudio_file_lists_declare_the_split(tmp_path):
    names = [f"images/{i}.png" for i in range(9)]
    write_captured(tmp_path, "transforms.json", names, train_filenames=names[:7], test_filenames=names[7:])
    for holdout in (0, 3):
        assert [view.name for view in open_capture(tmp_path, holdout=holdout).split("test")] == ["7", "8"]


@pytest.mark.parametrize("holdout", [1, -8])
def test_impossible_holdout_is_rejected(tmp_path, holdout):
    write_cameras(tmp_path / "transforms.json", rig(1))
    with pytest.raises(BadRequest, match="cannot be held out"):
        open_capture(tmp_path, photos=False, holdout=holdout)


def test_per_frame_intrinsics_override_global_ones(tmp_path):
    put(tmp_path / "a.png", png_bytes(8, 6))
    put(tmp_path / "b.png", png_bytes(4, 4))
    own = {"w": 4, "h": 4, "fl_x": 7.0, "cx": 1.5, "k1": 0.25}
    content = {"w": 8.0, "h": 6.0, "fl_x": 9.0, "fl_y": 10.0, "p2": 0.5, "frames": frames("a.png") + frames("b", **own)}
    put_json(tmp_path / "transforms.json", content)
    a, b = (view.camera for view in open_capture(tmp_path).views)
    assert (a.width, a.height, a.fx, a.fy, a.cx, a.cy, a.distortion) == (8, 6, 9, 10, 4, 3, (0, 0, 0, 0.5))
    assert (b.width, b.height, b.fx, b.fy, b.cx, b.cy, b.distortion) == (4, 4, 7, 10, 1.5, 2, (0.25, 0, 0, 0.5))


@pytest.mark.parametrize(
    ("file_path", "photo"),
    [
        ("images/1.jpeg", "images/1.jpeg"),
        ("./images/frame.0001", "images/frame.0001.png"),
        ("train/r_0", "rgb/train/r_0.png"),
        ("/home/somebody/data/images/1.png", "images/1.png"),
        ("C:\\Users\\somebody\\data\\images\\1.png", "images/1.png"),
        ("data/fox/images/1.webp", "images/1.webp"),
        ("images\\1", "images/1.JPG"),
    ],
)
def test_photos_are_found_from_inaccurate_paths(tmp_path, file_path, photo):
    put(tmp_path / photo, png_bytes(6, 4))
    put_json(tmp_path / "transforms.json", {"camera_angle_x": 1.0, "frames": frames(file_path)})
    assert open_capture(tmp_path).views[0].image == tmp_path / photo


def test_missing_photo_is_not_replaced_from_another_split(tmp_path):
    write_captured(tmp_path, "transforms_train.json", ["train/r_0", "train/r_1"])
    (tmp_path / "train" / "r_1.png").unlink()
    for name in ("test/r_1.png", "r_1.png"):
        put(tmp_path / name, png_bytes(4, 4))
    capture = open_capture(tmp_path)
    assert [view.stem for view in capture.views] == ["r_0"]
    assert capture.warnings == ("1 of 2 photos are missing and were skipped; the first is train/r_1.",)


@pytest.mark.parametrize(("declared", "expected"), [((60, 40), (60, 40)), ((40, 60), (40, 60)), (None, (40, 60))])
def test_rotated_photos_keep_the_orientation_of_their_camera(tmp_path, declared, expected):
    put(tmp_path / "a.jpg", jpeg_head(60, 40, orientation=6))
    size = {"w": declared[0], "h": declared[1]} if declared else {}
    put_json(tmp_path / "transforms.json", {"fl_x": 50, **size, "frames": frames("a.jpg")})
    capture = open_capture(tmp_path)
    camera = capture.views[0].camera
    assert (camera.width, camera.height, camera.fx, camera.fy) == (*expected, 50, 50) and capture.warnings == ()


def test_scaled_rotation_is_normalized_with_a_warning(open_one):
    pose = [[0, -2, 0, 7], [2, 0, 0, 8], [0, 0, 2, 9]]
    capture = open_one({"fl_x": 4, "frames": frames("a.png", transform_matrix=pose)})
    assert_allclose(capture.views[0].camera.camera_to_world, [[0, -1, 0, 7], [1, 0, 0, 8], [0, 0, 1, 9], [0, 0, 0, 1]])
    assert "scale of 2" in capture.warnings[0]


@pytest.mark.parametrize(
    ("fields", "is_fisheye", "coefficients"),
    [
        ({"camera_model": "OPENCV", "is_fisheye": True, "k1": 0.1, "k4": 0.3, "p1": 0.0}, True, (0.1, 0, 0, 0.3)),
        ({"is_fisheye": True}, True, ()),
        ({"k1": 0.1, "k4": 0.3}, False, (0.1, 0, 0, 0, 0, 0.3, 0, 0)),
    ],
)
def test_lenses_keep_their_coefficients(open_one, fields, is_fisheye, coefficients):
    camera = open_one({"fl_x": 4} | fields).views[0].camera
    assert (camera.fisheye, camera.distortion, camera.is_pinhole) == (is_fisheye, coefficients, False)


POINTS = np.array([[1.5, -2.0, 3.25], [0.0, 0.5, -7.0]])
COLORS = np.array([[255, 0, 10], [1, 2, 3]])


def ply(encoding: str) -> bytes:
    plyfile = pytest.importorskip("plyfile")
    columns = [(axis, "f4") for axis in "xyz"] + [(color, "u1") for color in ("red", "green", "blue")]
    rows = np.array([(*point, *color) for point, color in zip(POINTS, COLORS, strict=True)], columns)
    order = ">" if "big" in encoding else "<"
    stream = io.BytesIO()
    table = plyfile.PlyElement.describe(rows, "vertex", comments=["points"])
    plyfile.PlyData([table], text=encoding == "ascii", byte_order=order).write(stream)
    return stream.getvalue()


NERFSTUDIO = {
    "fl_x": 4,
    "aabb_scale": 16,
    "scale": 0.5,
    "offset": [1, 2, 3],
    "orientation_override": "none",
    "applied_transform": [[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0]],
    "ply_file_path": "sparse_pc.ply",
    "frames": frames("a.png", mask_path="masks/a.png", depth_file_path="depths/a.png", colmap_im_id=3),
}


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_nerfstudio_cameras_stay_unchanged_and_bring_their_points(tmp_path, open_one, encoding):
    put(tmp_path / "sparse_pc.ply", ply(encoding))
    capture = open_one(NERFSTUDIO)
    assert capture.warnings == ()
    assert_allclose(capture.views[0].camera.camera_to_world, POSE)
    assert_allclose(capture.points.positions, POINTS)
    assert_allclose(capture.points.colors, COLORS)
    assert np.isnan(capture.points.errors).all() and len(capture.points.view) == len(capture.points.pixels) == 0


def test_missing_points_give_a_warning(open_one):
    capture = open_one(NERFSTUDIO)
    assert capture.points is None and "sparse_pc.ply" in capture.warnings[0]
