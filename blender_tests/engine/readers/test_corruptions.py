"""Corruptions of valid files, and the error message that each must give."""

import json
import math
import struct
from functools import reduce
from operator import getitem
from pathlib import Path

import numpy as np
import pytest

from blender_tests.engine.readers.registry import readers
from blender_tests.engine.readers.samples import NAMES
from blender_tests.engine.reference.capture_files import ColmapModel, jpeg_head, png_bytes, put_photos
from blender_tests.engine.reference.no_files import NO_FILES
from blender_tests.engine.reference.still_life import cameras
from karf_engine.capture import open_capture
from karf_engine.cli import main
from karf_engine.errors import DataError

READERS = {reader.name: reader for reader in readers()}


def content(data):
    return lambda path: path.write_bytes(data)


def changed(function):
    return lambda path: path.write_bytes(function(path.read_bytes()))


def cut(share):
    return changed(lambda data: data[: int(len(data) * share)])


def beside(name, change):
    """Change another file, given by its path relative to the reader's own."""
    return lambda path: change(path.parent / name)


def of_sample(name, change):
    """Put another valid file in place of this one, and change it."""

    def replace(path):
        path.with_name(name).replace(path)
        change(path)

    return replace


def in_json(function):
    def change(path):
        value = json.loads(path.read_text())
        path.write_text(json.dumps(function(value) or value))

    return change


def fields(*removed, **values):
    return in_json(lambda value: {key: kept for key, kept in value.items() if key not in removed} | values)


def inside(*place):
    """Return a change of fields of the object at this place."""
    return lambda **values: in_json(lambda value: reduce(getitem, place, value).update(values))


frame, camera, view = inside("frames", 0), inside(1), inside("views", 0)


def pose(matrix):
    return frame(transform_matrix=matrix)


def model(function):
    """Write COLMAP's tables again after a change of their model."""

    def change(path):
        whole = ColmapModel(cameras(4, 8), NAMES)
        function(whole)
        whole.write(path.parent, path.suffix)

    return change


def lens(kind, width, height, *parameters):
    return model(lambda whole: whole.cameras.__setitem__(0, (7, kind, width, height, list(parameters))))


IMAGE_KEYS = ("number", "pose", "camera", "name", "features")
POINT_KEYS = ("number", "position", "color", "error", "track")


def with_values(row, keys, values):
    return tuple((dict(zip(keys, row, strict=True)) | values).values())


def pinhole(fx):
    return lens("PINHOLE", 8, 6, fx, 5.0, 4.0, 3.0)


def image(index, **values):
    return model(lambda whole: whole.images.insert(index, with_values(whole.images.pop(index), IMAGE_KEYS, values)))


def point(**values):
    return model(lambda whole: whole.points.insert(0, with_values(whole.points.pop(0), POINT_KEYS, values)))


def array(function):
    """Write an array again after a function changed it in place or returned another one."""

    def change(path):
        table = np.load(path)
        other = function(table)
        np.save(path, table if other is None else other)

    return change


def number(row, column, value):
    return array(lambda table: table.__setitem__((row, column), value))


def npy(value):
    return lambda path: np.save(path, value)


POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:1ce8274457\nsize 421531\n"
HUGE = struct.pack("<Q", 2**60)
POSE = np.eye(4).tolist()
IMAGE = struct.pack("<QI7dI", 1, 1, 1, 0, 0, 0, 0, 0, 0, 7)  # without its name
OTHER_NAMES = [{"file_path": name, "transform_matrix": POSE} for name in ("b.png", "c.png")]
EMPTY_SEGMENTS = [b"\xff\xd8\xff\xe0" + length + bytes(50) for length in (b"\0\0", b"\0\1")]  # of a JPEG
NO_HEADER = "no complete PNG, JPEG, WebP, TIFF, BMP, EXR, HEIC or AVIF header"
NO_PICTURE = "cannot be read as a picture"
NO_ARRAY = "not a complete array"
NO_POSE = "not a rotation and position"
NO_FILE = ", not a file"
IN_PLACE = [lambda path, make=make: (path.unlink(), make(path)) for make in NO_FILES]
PLY = b"ply\nformat ascii 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty %s z\nend_header\n"

# A row: words of the message, and the changes of the reader's first file that each must give it. The message must name
# this file, or instead the words before " … " where the row has them; with nothing before it, only the folder.
TABLE = {
    **{
        f"{table}.bin": [
            ("is cut off at byte", cut(0.5), cut(0.1), cut(0.97)),
            ("is empty", content(b"")),
            ("is cut off", changed(lambda data: HUGE + data[8:])),
            ("9 bytes after its last", changed(lambda data: data + b"123456789")),
            ("Git-LFS pointer", content(POINTER)),
            (NO_FILE, *IN_PLACE),
        ]
        for table in ("cameras", "images", "points3D")
    },
    **{
        f"{table}.txt": [
            ("not UTF-8 text", changed(lambda data: data + b"\xff\xfe")),
            ("line 2 does not hold", content(b"# list\n1 2 3\n")),
            ("line 1 does not hold", content(b"not the table you want")),
        ]
        for table in ("cameras", "images", "points3D")
    },
    "LLFF": [
        ("is empty", content(b"")),
        (NO_ARRAY, changed(lambda data: data[:50]), changed(lambda data: data[:-9])),
        (NO_ARRAY, changed(lambda data: data.replace(b"(4, 17), }         ", b"(400000000000, 17),}"))),
        (NO_ARRAY, content(b"1 2 3 4\n" * 10), changed(lambda data: b"\x93NUMPX" + data[6:])),
        (NO_ARRAY, npy(np.array([{}, []], object)), npy(np.full((4, 17), "word")), content(b"PK\x05\x06" + bytes(18))),
        ("shape (4, 16)", npy(np.ones((4, 16)))),
        ("shape (4, 3, 5)", npy(np.ones((4, 3, 5)))),
        ("shape ()", npy(np.float64(3))),
        ("shape (0, 17)", npy(np.ones((0, 17)))),
        ("row 0 has a pose that is not a rotation", array(lambda table: table * ([-1] * 4 + [1] * 13))),
        ("3 poses, but images has 4 photos", array(lambda table: table[:3])),
        ("4 poses, but images has 5 photos", lambda path: put_photos(path.parent / "images", ["more.png"])),
        ("no photos", beside("images", lambda photos: photos.rename(photos.with_name("away")))),
        (NO_FILE, *IN_PLACE),
    ],
    "NeX": [
        ("holds 5 numbers", npy(np.ones(5))),
        ("poses_bounds.npy … 14 columns, poses without focal lengths, and no hwf_cxcy.npy lies beside it", Path.unlink),
        ("poses_bounds.npy … principal point", npy(np.array([6, 8, 5, 5, math.nan, 3]))),
    ],
    "transforms.json": [
        ("fl_x = 0", fields(fl_x=0)),
        ("broken JSON", content(b""), cut(0.9)),
        ("cannot be read", content(b"\xff\xfe\x00\x80"), content(b"[" * 200_000)),
        ("cannot be read", content(b'{"fl_x": ' + b"9" * 10_000 + b"}")),
        ("JSON list", in_json(lambda value: [value])),
        ("JSON int", content(b"7")),
        ("no list of frames", fields("frames"), *(fields(frames=value) for value in ([], {"a": 1}, "all"))),
        ("frame 0 has no file_path", fields(frames=["a.png"]), fields(frames=[{"transform_matrix": POSE}])),
        ("neither fl_x nor camera_angle_x", fields("fl_x", "fl_y")),
        ("camera_angle_x = 50", fields("fl_x", camera_angle_x=50)),
        ("fl_x = 'wide'", fields(fl_x="wide")),
        ("fl_x = nan", fields(fl_x=math.nan)),
        ("must be positive", fields(fl_x=-4)),
        ("w = 0", fields(w=0)),
        ("w = [8]", fields(w=[8])),
        ("declares 1e+30x", fields(w=1e30)),
        ("h = -6", fields(h=-6)),
        ("360-degree photo of", fields(camera_model="EQUIRECTANGULAR")),
        ("FISHEYE624 camera", fields(camera_model="FISHEYE624")),
        ("['OPENCV'] camera", fields(camera_model=["OPENCV"])),
        ("k4 = 'none'", fields(k4="none")),
        ("frame 0", fields(frames=[{"file_path": f"images/{NAMES[0]}"}])),
        (" … none of its 1 photos was found", fields(frames=[{"file_path": "a" * 5000, "transform_matrix": POSE}])),
        (" … none of its 2 photos was found", fields(frames=OTHER_NAMES)),
        ("gone.ply … missing", fields(splat_file_path="gone.ply")),
        ("points.ply … cut off", beside("points.ply", cut(0.97))),
    ],
    "camera file": [("declares no picture size", fields("w"))],
    "cameras of a splat": [
        ("", content(b"{}"), content(b"[]"), content(b"["), content(b'"x"'), content(b"[1]")),
        ("camera 1", camera(rotation=[[1, 0], [0, 1]]), camera(rotation=[[1, 0, 0], [0, 1, 0], [0, 0, math.nan]])),
        ("camera 1", camera(position="here"), camera(width=None), camera(width=-5), camera(fx=0)),
        ("rotation", camera(rotation=[[1, 0, 0], [0, 3, 0], [0, 0, 1]])),
    ],
    "canonical capture": [
        ("gains", view(gains=[1.0, 0.0, 1.0])),
        ("not a canonical capture", fields(splats={"is_antialiased": True})),
    ],
    "points in PLY": [
        ("is empty", content(b"")),
        ("header cannot be understood", content(b"solid cube\n"), content(PLY % (-1, b"float"))),
        ("header cannot be understood", content(PLY % (1, b"half") + b"1 2 3")),
        ("cut off", content(PLY % (2, b"float") + b"1 2 3 4 5"), content(PLY % (10**15, b"float") + b"1 2 3")),
        ("cut off", changed(lambda data: data[:-2])),
        ("not numbers", content(PLY % (1, b"float") + b"1 2 three")),
        ("not finite", content(PLY % (1, b"float") + b"1 2 nan")),
    ],
    "header of a picture": [
        ("is empty", content(b"")),
        ("Git-LFS pointer", content(POINTER)),
        ("copied as text", changed(lambda data: data.decode("utf-8", "replace").encode())),
        (NO_HEADER, content(b"<html>404</html>"), content(png_bytes(4, 4)[:18]), content(png_bytes(0, 4))),
        (NO_HEADER, content(jpeg_head(4, 4)[:42])),
        (NO_PICTURE, *map(content, EMPTY_SEGMENTS)),
        (NO_FILE, *IN_PLACE),
    ],
    "PNG": [
        ("is empty", content(b"")),
        ("Git-LFS pointer", content(POINTER)),
        (NO_PICTURE, content(b"hello, no picture"), cut(0.7), of_sample("deep.png", cut(0.7))),
        ("does not exist", Path.unlink),
        (NO_FILE, *IN_PLACE),
    ],
    "JPEG": [(NO_PICTURE, *map(content, EMPTY_SEGMENTS))],
    "WebP, BMP, TIFF": [(NO_PICTURE, of_sample("deep.tif", cut(0.5)))],
    "EXR": [(NO_PICTURE, cut(0.5))],
    "mask": [(NO_FILE, *IN_PLACE)],
}  # fmt: skip

TABLE["cameras.bin"] += [
    ("holds no cameras", content(struct.pack("<Q", 0))),
    ("camera model id 99, which is unknown", lens(99, 8, 6, 5.0)),
    ("camera model id -1, which is unknown", lens(-1, 8, 6)),
    ("images.bin … cannot be", pinhole(0.0), lens("PINHOLE", 2**63, 6, 5.0, 5.0, 4.0, 3.0)),
    ("images.bin … fx nan", pinhole(math.nan)),
    ("images.bin … coefficient inf", lens("SIMPLE_RADIAL", 8, 6, 5.0, 4.0, 3.0, math.inf)),
]
TABLE["cameras.txt"] += [
    ("camera model HOLOGRAM, which is unknown", lens("HOLOGRAM", 8, 6, 5.0)),
    ("2 parameters where PINHOLE has 4", lens("PINHOLE", 8, 6, 5.0, 5.0)),
    ("images.txt … fx -5", pinhole(-5.0)),
    ("images.txt … -8x6 pixels", lens("PINHOLE", -8, 6, 5.0, 5.0, 4.0, 3.0)),
    ("two entries of camera 7", changed(lambda data: data + data)),
]
TABLE["images.bin"] += [
    ("is cut off", content(IMAGE + b"a.png\0" + HUGE), content(IMAGE + b"a.png")),
    ("two entries of image 100", image(1, number=100)),
    ("name that is not UTF-8", image(0, name=b"\xff\xfe.png")),
    ("sparse/0 … '../000.png'", image(0, name="../000.png")),
    ("sparse/0 … not a path below", image(0, name="C:\\x\\000.png")),
    ("sparse/0 … ''", image(0, name="")),
    ("sparse/0 … cameras.bin, points3D.bin, but not", Path.unlink),
    ("sparse/0 … none of its 4 photos", beside("../../images", lambda photos: photos.rename(photos.with_name("away")))),
]
TABLE["images.txt"] += [
    ("holds no images", content(b"# nothing\n")),
    ("sparse/0 … '/home/x/000.png'", image(0, name="/home/x/000.png")),
    ("does not hold the features", content(b"1 1 0 0 0 0 0 0 7 000.png\n1.5 2.5\n")),
    ("line 2 does not hold the features", content(b"1 1 0 0 0 0 0 0 7 0.png\n2 1 0 0 0 0 0 0 7 1.png\n")),
]
TABLE["points3D.bin"] += [
    ("is cut off", content(struct.pack("<QQ3d3BdQ", 1, 1, 0, 0, 0, 0, 0, 0, 0, 2**61))),
    ("two points of one id", point(number=37)),
]
TABLE["points3D.txt"] += [
    ("not finite", point(position=[0, math.nan, 0])),
    ("line 2 does not hold", point(color=[0, 256, 0])),
]
# Damage of one of four photos, which is left out; the remark has these words.
ONE_PHOTO = {
    "images.bin": [
        (NO_POSE, image(1, pose=np.full(7, math.nan)), image(1, pose=np.full(7, 1e200))),
        ("features that are not finite", image(2, features=[(math.nan, 1.0, -1)])),
        ("camera 12, which is missing from cameras.bin", image(0, camera=12)),
        (f"{NAMES[0]} is a Git-LFS pointer", beside(f"../../images/{NAMES[0]}", content(POINTER))),
    ],
    "images.txt": [
        (NO_POSE, image(1, pose=np.zeros(7))),
    ],
    "LLFF": [
        ("row 2 has a pose that is not finite", number(2, 3, math.nan)),
        ("row 1 has a pose that is not a rotation", number(1, 0, 2.0)),
        ("row 3 has the focal length", number(3, 14, 0), number(3, 14, math.nan)),
        ("row 0 has a picture of", number(0, 4, -6)),
    ],
    "transforms.json": [
        ("frame 0 has no file_path", frame(file_path="")),
        ("frame 1 has no file_path", in_json(lambda value: value["frames"].__setitem__(1, []))),
        ("no 4x4", pose([[1, 0, 0], [0, 1], [0]]), pose(POSE[:3][:2]), pose([["a"] * 4] * 4)),
        ("no 4x4", pose(np.eye(3).tolist()), pose([[10**400, 0, 0, 0], *POSE[1:]])),
        ("not finite", pose([[1, 0, 0, math.inf], *POSE[1:]]), pose((np.eye(4) * 1e200).tolist())),
        ("uniform scale", pose([[2, 0, 0, 0], *POSE[1:]]), pose([[1, 0.6, 0, 0], [0, 0.8, 0, 0], *POSE[2:]])),
        ("uniform scale", pose([[-1, 0, 0, 0], *POSE[1:]]), pose(np.zeros((4, 4)).tolist())),
        (f"{NAMES[0]} is a Git-LFS pointer", beside(f"images/{NAMES[0]}", content(POINTER))),
    ],
}


def rows_of(table):
    return [(name, words, change) for name, rows in table.items() for words, *changes in rows for change in changes]


def ids_of(table):
    return [f"{name}: {words}" for name, words, _ in rows_of(table)]


def corrupt(folder, name, change):
    """Make the reader's valid files and change the first."""
    READERS[name].make(folder)
    path = folder / READERS[name].files[0]
    change(path)
    return path


@pytest.mark.parametrize(("name", "words", "change"), rows_of(TABLE), ids=ids_of(TABLE))
def test_corrupted_file_is_rejected_with_its_name_and_a_remedy(tmp_path, name, words, change):
    path = corrupt(tmp_path, name, change)
    with pytest.raises(DataError) as caught:
        READERS[name].read(path)
    sentence = caught.value.sentence
    named = words.split(" … ") if " … " in words else [path.name, words]
    assert [part for part in (str(tmp_path), *named) if part not in sentence] == []
    assert sentence.endswith(".") and "\n" not in sentence
    assert caught.value.hint.endswith(".")


@pytest.mark.parametrize(("name", "words", "change"), rows_of(ONE_PHOTO), ids=ids_of(ONE_PHOTO))
def test_damage_of_one_photo_leaves_it_out(tmp_path, name, words, change):
    corrupt(tmp_path, name, change)
    capture = open_capture(tmp_path)
    (remark,) = [text for text in capture.warnings if "left out" in text]
    assert len(capture.views) == 3
    assert remark.startswith("1 of 4 photos were left out: ") and words in remark and str(tmp_path) in remark


@pytest.mark.parametrize("name", ["images.bin", "LLFF", "transforms.json"])
def test_failing_geometry_command_exits_with_four_and_leaves_nothing(tmp_path, capsys, name):
    capture, project = tmp_path / "capture", tmp_path / "project"
    capture.mkdir()
    words, change = TABLE[name][0][:2]
    path = corrupt(capture, name, change)
    assert main(["geometry", str(capture), "--project", str(project)]) == DataError.exit_code
    errors = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
    assert len(errors) == 1 and path.name in errors[0] and words in errors[0]
    assert not project.exists()
