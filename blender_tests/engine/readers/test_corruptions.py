"""The table of corruptions: what is done to a reader's valid file, and the sentence that it ends in."""

import io
import json
import math
import struct
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")

from blender_tests.engine.readers.registry import readers
from blender_tests.engine.readers.samples import NAMES, ply_text
from blender_tests.engine.reference.capture_files import ColmapModel, jpeg_head, png_bytes, put_photos
from blender_tests.engine.reference.no_files import NO_FILES
from blender_tests.engine.reference.still_life import cameras
from karf_engine.cli import main
from karf_engine.errors import DataError

READERS = {reader.name: reader for reader in readers(None)}


# ------------------------------------------------------------------------------------------------------ what can be done
def content(data):
    return lambda path: path.write_bytes(data)


def changed(function):
    return lambda path: path.write_bytes(function(path.read_bytes()))


def cut(share):
    return changed(lambda data: data[: int(len(data) * share)])


def beside(name, change):
    """The change of another file, whose path is given from the reader's own."""
    return lambda path: change(path.parent / name)


def of_sample(name, change):
    """The change of another valid file, in place of this one."""

    def replace(path):
        path.with_name(name).replace(path)
        change(path)

    return replace


def in_place(make):
    """Something that is no file, in place of it."""

    def change(path):
        path.unlink()
        make(path)

    return change


def in_json(function):
    def change(path):
        value = json.loads(path.read_text())
        path.write_text(json.dumps(function(value) or value))

    return change


def fields(**values):
    return in_json(lambda value: value.update(values))


def without(*keys, **values):
    return in_json(lambda value: {key: kept for key, kept in value.items() if key not in keys} | values)


def frame(**values):
    return in_json(lambda value: value["frames"][0].update(values))


def frames(*values):
    return fields(frames=list(values))


def camera(**values):
    """Change the second camera of a splat."""
    return in_json(lambda value: value[1].update(values))


def model(function):
    """Write a table of COLMAP again, after a change of the model that all three were written from."""

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


def image(index, **values):
    return model(lambda whole: whole.images.insert(index, with_values(whole.images.pop(index), IMAGE_KEYS, values)))


def point(**values):
    return model(lambda whole: whole.points.insert(0, with_values(whole.points.pop(0), POINT_KEYS, values)))


def array(function):
    """Write an array again that a function has changed in place, or another one."""

    def change(path):
        table = np.load(path)
        other = function(table)
        np.save(path, table if other is None else other)

    return change


def number(row, column, value):
    return array(lambda table: table.__setitem__((row, column), value))


def npy(value):
    stream = io.BytesIO()
    np.save(stream, value)
    return content(stream.getvalue())


# ------------------------------------------------------------------------------------------------------------- the table
POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:1ce8274457\nsize 421531\n"
HUGE = struct.pack("<Q", 2**60)
POSE = np.eye(4).tolist()
IMAGE = struct.pack("<QI7dI", 1, 1, 1, 0, 0, 0, 0, 0, 0, 7)  # without its name
OTHER_NAMES = [{"file_path": name, "transform_matrix": POSE} for name in ("b.png", "c.png")]
EMPTY_SEGMENTS = [b"\xff\xd8\xff\xe0" + length + bytes(50) for length in (b"\0\0", b"\0\1")]  # of a JPEG
NO_HEADER = "no complete PNG, JPEG, WebP, TIFF, BMP or EXR header"
NO_PICTURE = "cannot be read as a picture"
NO_ARRAY = "not a complete array"
NO_POSE = "not a rotation and position"
PLY = b"ply\nformat ascii 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty %s z\nend_header\n"

# a row: what is done to the reader's first file, words of the sentence, and the file that it names if another
TABLE = {
    **{
        f"{table}.bin": [
            *((cut(share), "is cut off at byte") for share in (0.5, 0.1, 0.97)),
            (content(b""), "is empty"),
            (changed(lambda data: HUGE + data[8:]), "is cut off"),
            (changed(lambda data: data + b"123456789"), "9 bytes after its last"),
            (content(POINTER), "Git-LFS pointer"),
            *((in_place(make), ", not a file") for make in NO_FILES),
        ]
        for table in ("cameras", "images", "points3D")
    },
    **{
        f"{table}.txt": [
            (changed(lambda data: data + b"\xff\xfe"), "not UTF-8 text"),
            (content(b"# list\n1 2 3\n"), "line 2 does not hold"),
            (content(b"not the table you want"), "line 1 does not hold"),
        ]
        for table in ("cameras", "images", "points3D")
    },
    "LLFF": [
        (number(2, 3, math.nan), "row 2 has a pose that is not finite"),
        (content(b""), "is empty"),
        (changed(lambda data: data[:50]), NO_ARRAY),
        (changed(lambda data: data[:-9]), NO_ARRAY),
        (content(b"1 2 3 4\n" * 10), NO_ARRAY),
        (changed(lambda data: b"\x93NUMPX" + data[6:]), NO_ARRAY),
        (changed(lambda data: data.replace(b"(4, 17), }         ", b"(400000000000, 17),}")), NO_ARRAY),
        (npy(np.array([{}, []], object)), NO_ARRAY),
        (content(b"PK\x05\x06" + b"\0" * 18), NO_ARRAY),
        (npy(np.full((4, 17), "word")), NO_ARRAY),
        (npy(np.ones((4, 16))), "shape (4, 16)"),
        (npy(np.ones((4, 3, 5))), "shape (4, 3, 5)"),
        (npy(np.float64(3)), "shape ()"),
        (npy(np.ones((0, 17))), "shape (0, 17)"),
        (number(1, 0, 2.0), "row 1 has a pose that is not a rotation"),
        (array(lambda table: table * ([-1] * 4 + [1] * 13)), "row 0 has a pose that is not a rotation"),
        (number(3, 14, 0), "row 3 has the focal length"),
        (number(3, 14, math.nan), "row 3 has the focal length"),
        (number(0, 4, -6), "row 0 has a picture of"),
        (array(lambda table: table[:3]), "3 poses, but images has 4 photos"),
        (lambda path: put_photos(path.parent / "images", ["more.png"]), "4 poses, but images has 5 photos"),
        (lambda path: (path.parent / "images").rename(path.parent / "away"), "no photos"),
        *((in_place(make), ", not a file") for make in NO_FILES),
    ],
    "NeX": [
        (npy(np.ones(5)), "holds 5 numbers"),
        (Path.unlink, "14 columns, poses without focal lengths, and no hwf_cxcy.npy lies beside it", "poses_bounds.npy"),
        (npy(np.array([6, 8, 5, 5, math.nan, 3])), "principal point", "poses_bounds.npy"),
    ],
    "transforms.json": [
        (fields(fl_x=0), "fl_x = 0"),
        (content(b""), "broken JSON"),
        (cut(0.9), "broken JSON"),
        (content(b"\xff\xfe\x00\x80"), "cannot be read"),
        (content(b"[" * 200_000), "cannot be read"),
        (content(b'{"fl_x": ' + b"9" * 10_000 + b"}"), "cannot be read"),
        (in_json(lambda value: [value]), "JSON list"),
        (content(b"7"), "JSON int"),
        (without("frames"), "no list of frames"),
        *((fields(frames=value), "no list of frames") for value in ([], {"a": 1}, "all")),
        (frames("a.png"), "frame 0 has no file_path"),
        (frames({"transform_matrix": POSE}), "frame 0 has no file_path"),
        (frame(file_path=""), "frame 0 has no file_path"),
        (in_json(lambda value: value["frames"].__setitem__(1, [])), "frame 1 has no file_path"),
        (without("fl_x", "fl_y"), "neither fl_x nor camera_angle_x"),
        (without("fl_x", camera_angle_x=50), "camera_angle_x = 50"),
        (fields(fl_x="wide"), "fl_x = 'wide'"),
        (fields(fl_x=math.nan), "fl_x = nan"),
        (fields(fl_x=-4), "must be positive"),
        (fields(w=0), "w = 0"),
        (fields(w=[8]), "w = [8]"),
        (fields(w=1e30), "declares 1e+30x"),
        (fields(h=-6), "h = -6"),
        (fields(camera_model="EQUIRECTANGULAR"), "EQUIRECTANGULAR"),
        (fields(camera_model="FISHEYE624"), "FISHEYE624 camera"),
        (fields(camera_model=["OPENCV"]), "['OPENCV'] camera"),
        (fields(k4="none"), "k4 = 'none'"),
        (frames({"file_path": f"images/{NAMES[0]}"}), "frame 0"),
        (frame(transform_matrix=[[1, 0, 0], [0, 1], [0]]), "no 4x4"),
        (frame(transform_matrix=np.eye(3).tolist()), "no 4x4"),
        (frame(transform_matrix=[["a"] * 4] * 4), "no 4x4"),
        (frame(transform_matrix=[[10**400, 0, 0, 0], *POSE[1:]]), "no 4x4"),
        (frame(transform_matrix=[[1, 0, 0, math.inf], *POSE[1:]]), "not finite"),
        (frame(transform_matrix=(np.eye(4) * 1e200).tolist()), "not finite"),
        (frame(transform_matrix=[[2, 0, 0, 0], *POSE[1:]]), "uniform scale"),
        (frame(transform_matrix=[[1, 0.6, 0, 0], [0, 0.8, 0, 0], *POSE[2:]]), "uniform scale"),
        (frame(transform_matrix=[[-1, 0, 0, 0], *POSE[1:]]), "uniform scale"),
        (frame(transform_matrix=np.zeros((4, 4)).tolist()), "uniform scale"),
        (frames({"file_path": "a" * 5000, "transform_matrix": POSE}), "none of its 1 photos was found", ""),
        (frames(*OTHER_NAMES), "none of its 2 photos was found", ""),
        (fields(splat_file_path="gone.ply"), "missing", "gone.ply"),
        (beside("points.ply", cut(0.97)), "cut off", "points.ply"),
        (beside(f"images/{NAMES[0]}", content(POINTER)), "Git-LFS pointer", NAMES[0]),
    ],
    "camera file": [(without("w"), "declares no picture size")],
    "cameras of a splat": [
        *((content(text), "") for text in (b"{}", b"[]", b"[", b'"x"', b"[1]")),
        (camera(rotation=[[1, 0], [0, 1]]), "camera 1"),
        (camera(rotation=[[1, 0, 0], [0, 1, 0], [0, 0, math.nan]]), "camera 1"),
        (camera(rotation=[[1, 0, 0], [0, 3, 0], [0, 0, 1]]), "rotation"),
        (camera(position="here"), "camera 1"),
        (camera(width=None), "camera 1"),
        (camera(width=-5), "camera 1"),
        (camera(fx=0), "camera 1"),
    ],
    "canonical capture": [
        (in_json(lambda value: value["views"][0].update(gains=[1.0, 0.0, 1.0])), "gains"),
        (fields(splats={"is_antialiased": True}), "not a canonical capture"),
    ],
    "points in PLY": [
        (content(b""), "is empty"),
        (content(b"solid cube\n"), "header cannot be understood"),
        (content(PLY % (2, b"float") + b"1 2 3 4 5"), "cut off"),
        (content(PLY % (10**15, b"float") + b"1 2 3"), "cut off"),
        (content(PLY % (-1, b"float")), "header cannot be understood"),
        (content(PLY % (1, b"float") + b"1 2 three"), "not numbers"),
        (content(PLY % (1, b"float") + b"1 2 nan"), "not finite"),
        (content(PLY % (1, b"half") + b"1 2 3"), "header cannot be understood"),
        (content(ply_text()[:-2]), "cut off"),
    ],
    "header of a picture": [
        (content(b""), "is empty"),
        (content(POINTER), "Git-LFS pointer"),
        (changed(lambda data: data.decode("utf-8", "replace").encode()), "copied as text"),
        (content(b"<html>404</html>"), NO_HEADER),
        (content(png_bytes(4, 4)[:18]), NO_HEADER),
        (content(png_bytes(0, 4)), NO_HEADER),
        (content(jpeg_head(4, 4)[:42]), NO_HEADER),
        *((content(data), NO_PICTURE) for data in EMPTY_SEGMENTS),
        *((in_place(make), ", not a file") for make in NO_FILES),
    ],
    "PNG": [
        (content(b""), "is empty"),
        (content(POINTER), "Git-LFS pointer"),
        (content(b"hello, no picture"), NO_PICTURE),
        (cut(0.7), NO_PICTURE),
        (of_sample("deep.png", cut(0.7)), NO_PICTURE),
        (Path.unlink, "does not exist"),
        *((in_place(make), ", not a file") for make in NO_FILES),
    ],
    "JPEG": [(content(data), NO_PICTURE) for data in EMPTY_SEGMENTS],
    "WebP, BMP, TIFF": [(of_sample("deep.tif", cut(0.5)), NO_PICTURE)],
    "EXR": [(cut(0.5), NO_PICTURE)],
    "mask": [(in_place(make), ", not a file") for make in NO_FILES],
}  # fmt: skip

TABLE["cameras.bin"] += [
    (content(struct.pack("<Q", 0)), "holds no cameras"),
    (lens(99, 8, 6, 5.0), "camera model id 99, which is unknown"),
    (lens(-1, 8, 6), "camera model id -1, which is unknown"),
    (lens("PINHOLE", 8, 6, 0.0, 5.0, 4.0, 3.0), "cannot be", "images.bin"),
    (lens("PINHOLE", 8, 6, math.nan, 5.0, 4.0, 3.0), "fx nan", "images.bin"),
    (lens("PINHOLE", 2**63, 6, 5.0, 5.0, 4.0, 3.0), "cannot be", "images.bin"),
    (lens("SIMPLE_RADIAL", 8, 6, 5.0, 4.0, 3.0, math.inf), "coefficient inf", "images.bin"),
]
TABLE["cameras.txt"] += [
    (lens("HOLOGRAM", 8, 6, 5.0), "camera model HOLOGRAM, which is unknown"),
    (lens("PINHOLE", 8, 6, 5.0, 5.0), "2 parameters where PINHOLE has 4"),
    (lens("PINHOLE", 8, 6, 5.0, -5.0, 4.0, 3.0), "fy -5", "images.txt"),
    (lens("PINHOLE", -8, 6, 5.0, 5.0, 4.0, 3.0), "-8x6 pixels", "images.txt"),
    (changed(lambda data: data + data), "two entries of camera 7"),
]
TABLE["images.bin"] += [
    (content(IMAGE + b"a.png\0" + HUGE), "is cut off"),
    (content(IMAGE + b"a.png"), "is cut off"),
    (image(1, pose=np.full(7, math.nan)), NO_POSE),
    (image(1, pose=np.full(7, 1e200)), NO_POSE),
    (image(2, features=[(math.nan, 1.0, -1)]), "features that are not finite"),
    (image(1, number=100), "two entries of image 100"),
    (image(0, camera=12), "camera 12, which cameras.bin does not hold"),
    (image(0, name=b"\xff\xfe.png"), "name that is not UTF-8"),
    (image(0, name="../000.png"), "'../000.png'", "sparse/0"),
    (image(0, name="C:\\x\\000.png"), "not a path below", "sparse/0"),
    (image(0, name=""), "''", "sparse/0"),
    (Path.unlink, "cameras.bin, points3D.bin, but not", "sparse/0"),
    (lambda path: (path.parents[2] / "images").rename(path.parents[2] / "away"), "none of its 4 photos", "sparse/0"),
    (beside(f"../../images/{NAMES[0]}", content(POINTER)), "Git-LFS pointer", NAMES[0]),
]
TABLE["images.txt"] += [
    (content(b"# nothing\n"), "holds no images"),
    (image(1, pose=np.zeros(7)), NO_POSE),
    (image(0, name="/home/x/000.png"), "'/home/x/000.png'", "sparse/0"),
    (content(b"1 1 0 0 0 0 0 0 7 000.png\n1.5 2.5\n"), "does not hold the features"),
    (content(b"".join(b"%d 1 0 0 0 0 0 0 7 00%d.png\n" % (n, n) for n in (1, 2))), "line 2 does not hold the features"),
]
TABLE["points3D.bin"] += [
    (content(struct.pack("<QQ3d3BdQ", 1, 1, 0, 0, 0, 0, 0, 0, 0, 2**61)), "is cut off"),
    (point(number=37), "two points of one id"),
    (point(track=[(55, 0)]), "seen by image 55"),
]
TABLE["points3D.txt"] += [
    (point(position=[0, math.nan, 0]), "not finite"),
    (point(color=[0, 256, 0]), "line 2 does not hold"),
]
ROWS = [(name, *row) for name, rows in TABLE.items() for row in rows]
IDS = [f"{name}: {words}" for name, _, words, *_ in ROWS]


@pytest.mark.parametrize("row", ROWS, ids=IDS)
def test_a_corrupted_file_ends_in_one_sentence_that_names_it_and_a_remedy(tmp_path, row):
    name, change, words, *named = row
    reader = READERS[name]
    reader.make(tmp_path)
    path = tmp_path / reader.files[0]
    change(path)
    with pytest.raises(DataError) as caught:
        reader.read(path)
    sentence = caught.value.sentence
    assert str(tmp_path) in sentence and words in sentence and (named or [path.name])[0] in sentence
    assert sentence.endswith(".") and "\n" not in sentence
    assert caught.value.hint.endswith(".")


@pytest.mark.parametrize("name", ["images.bin", "LLFF", "transforms.json"])
def test_the_command_line_ends_with_four_and_leaves_nothing(tmp_path, capsys, name):
    reader, (change, words, *_) = READERS[name], TABLE[name][0]
    capture, project = tmp_path / "capture", tmp_path / "project"
    capture.mkdir()
    reader.make(capture)
    change(capture / reader.files[0])
    assert main(["geometry", str(capture), "--project", str(project)]) == DataError.exit_code
    errors = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
    assert len(errors) == 1 and Path(reader.files[0]).name in errors[0] and words in errors[0]
    assert not project.exists()
