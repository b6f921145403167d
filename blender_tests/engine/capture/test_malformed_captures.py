"""Damaged captures of every format: one sentence that names the file, a remedy, and nothing left behind."""

import json
import math
import struct

import numpy as np
import pytest

from blender_tests.engine.reference.capture_files import (
    ColmapModel,
    centered,
    llff_table,
    put,
    put_json,
    put_photos,
    random_rig,
    write_colmap,
    write_llff,
    write_transforms,
)
from karf_engine.capture import open_capture
from karf_engine.errors import DataError

NAMES = [f"{number:03d}.png" for number in range(4)]
CAMERAS = [centered(camera) for camera in random_rig(8, 4)]
CASES = {}


def case(name, file, words):
    """A kind of damage: the function writes it into a folder; the sentence must name `file` and say `words`."""

    def add(write):
        assert name not in CASES
        CASES[name] = (write, file, words)

    return add


# ---------------------------------------------------------------------------------------------------------------- COLMAP
def binary(change=None, **tables):
    """Write a binary model, changed by `change(model)`, with tables replaced by bytes or by a function of theirs."""

    def write(folder):
        model = ColmapModel(CAMERAS, NAMES)
        if change:
            change(model)
        put_photos(folder / "images", NAMES, CAMERAS)
        model.write(folder / "sparse/0")
        replace_tables(folder, tables, ".bin")

    return write


def text(change=None, **tables):
    """The same in text."""

    def write(folder):
        model = ColmapModel(CAMERAS, NAMES)
        if change:
            change(model)
        put_photos(folder / "images", NAMES, CAMERAS)
        model.write(folder / "sparse/0", ".txt")
        replace_tables(folder, tables, ".txt")

    return write


def replace_tables(folder, tables, suffix):
    for table, content in tables.items():
        path = folder / "sparse/0" / f"{table}{suffix}"
        path.write_bytes(content(path.read_bytes()) if callable(content) else content)


def cut(share):
    return lambda data: data[: int(len(data) * share)]


def lens(*values):
    """Set (model, width, height, parameters) of the only camera."""

    def change(model):
        model.cameras[0] = (7, *values)

    return change


def image(index, **fields):
    """Change fields of an image of the model."""
    keys = ("number", "pose", "camera", "name", "features")

    def change(model):
        model.images[index] = tuple({**dict(zip(keys, model.images[index], strict=True)), **fields}.values())

    return change


def point(**fields):
    keys = ("number", "position", "color", "error", "track")

    def change(model):
        model.points[0] = tuple({**dict(zip(keys, model.points[0], strict=True)), **fields}.values())

    return change


HUGE = struct.pack("<Q", 2**60)
PINHOLE = ("PINHOLE", 8, 6)
for table in ("cameras", "images", "points3D"):
    for share in (0.1, 0.5, 0.97):
        case(f"{table}.bin cut at {share}", f"{table}.bin", "is cut off at byte")(binary(**{table: cut(share)}))
    case(f"{table}.bin is empty", f"{table}.bin", "is empty")(binary(**{table: b""}))
    case(f"{table}.bin counts 2^60", f"{table}.bin", "is cut off")(binary(**{table: lambda data: HUGE + data[8:]}))
    case(f"{table}.bin has more than it counts", f"{table}.bin", "9 bytes after its last")(
        binary(**{table: lambda data: data + b"123456789"})
    )
    case(f"{table}.bin is a pointer", f"{table}.bin", "Git-LFS pointer")(
        binary(**{table: b"version https://git-lfs.github.com/spec/v1\noid sha256:1ce8274457\nsize 421531\n"})
    )
    case(f"{table}.txt is not UTF-8", f"{table}.txt", "not UTF-8 text")(
        text(**{table: lambda data: data + b"\xff\xfe"})
    )
    case(f"{table}.txt lacks columns", f"{table}.txt", "line 2 does not hold")(text(**{table: b"# list\n1 2 3\n"}))
    case(f"{table}.txt is prose", f"{table}.txt", "line 1 does not hold")(text(**{table: b"not the table you want"}))

case("no cameras", "cameras.bin", "holds no cameras")(binary(cameras=struct.pack("<Q", 0)))
case("no images", "images.txt", "holds no images")(text(images=b"# nothing\n"))
case("an image with 2^60 features", "images.bin", "is cut off")(
    binary(images=struct.pack("<QI7dI", 1, 1, 1, 0, 0, 0, 0, 0, 0, 7) + b"a.png\0" + HUGE)
)
case("a point with a track of 2^61", "points3D.bin", "is cut off")(
    binary(points3D=struct.pack("<QQ3d3BdQ", 1, 1, 0, 0, 0, 0, 0, 0, 0, 2**61))
)
case("a name without end", "images.bin", "is cut off")(
    binary(images=struct.pack("<QI7dI", 1, 1, 1, 0, 0, 0, 0, 0, 0, 7) + b"a.png")
)
case("camera model id 99", "cameras.bin", "camera model id 99, which is unknown")(binary(lens(99, 8, 6, [5.0])))
case("camera model id -1", "cameras.bin", "camera model id -1, which is unknown")(binary(lens(-1, 8, 6, [])))
case("camera model of the future", "cameras.txt", "camera model HOLOGRAM, which is unknown")(
    text(lens("HOLOGRAM", 8, 6, [5.0]))
)
case("too few parameters", "cameras.txt", "2 parameters where PINHOLE has 4")(text(lens(*PINHOLE, [5.0, 5.0])))
case("zero focal length", "images.bin", "cannot be")(binary(lens(*PINHOLE, [0.0, 5.0, 4.0, 3.0])))
case("negative focal length", "images.txt", "fy -5")(text(lens(*PINHOLE, [5.0, -5.0, 4.0, 3.0])))
case("focal length is nan", "images.bin", "fx nan")(binary(lens(*PINHOLE, [math.nan, 5.0, 4.0, 3.0])))
case("coefficient is inf", "images.bin", "coefficient inf")(
    binary(lens("SIMPLE_RADIAL", 8, 6, [5.0, 4.0, 3.0, math.inf]))
)
case("negative size", "images.txt", "-8x6 pixels")(text(lens("PINHOLE", -8, 6, [5.0, 5.0, 4.0, 3.0])))
case("a size of 2^63", "images.bin", "cannot be")(binary(lens("PINHOLE", 2**63, 6, [5.0, 5.0, 4.0, 3.0])))
case("pose of nan", "images.bin", "not a rotation and position")(binary(image(1, pose=np.full(7, math.nan))))
case("quaternion of zeros", "images.txt", "not a rotation and position")(text(image(1, pose=np.zeros(7))))
case("feature at nan", "images.bin", "features that are not finite")(binary(image(2, features=[(math.nan, 1.0, -1)])))
case("quaternion of 1e200", "images.bin", "not a rotation and position")(binary(image(1, pose=np.full(7, 1e200))))
case("two images of one id", "images.bin", "two entries of image 100")(binary(image(1, number=100)))
case("two cameras of one id", "cameras.txt", "two entries of camera 7")(text(cameras=lambda data: data + data))
case("two points of one id", "points3D.bin", "two points of one id")(binary(point(number=37)))
case("unknown camera", "images.bin", "camera 12, which cameras.bin does not hold")(binary(image(0, camera=12)))
case("points of unknown images", "points3D.bin", "seen by image 55")(binary(point(track=[(55, 0)])))
case("point at nan", "points3D.txt", "not finite")(text(point(position=[0, math.nan, 0])))
case("color beyond 255", "points3D.txt", "line 2 does not hold")(text(point(color=[0, 256, 0])))
case("half an observation", "images.txt", "does not hold the features")(
    text(images=b"1 1 0 0 0 0 0 0 7 000.png\n1.5 2.5\n")
)
case("no line for the features", "images.txt", "line 2 does not hold the features")(
    text(images=b"1 1 0 0 0 0 0 0 7 000.png\n2 1 0 0 0 0 0 0 7 001.png\n")
)
case("name leaves the folder", "sparse/0", "'../000.png'")(binary(image(0, name="../000.png")))
case("name is a foreign path", "sparse/0", "'/home/x/000.png'")(text(image(0, name="/home/x/000.png")))
case("name is a path of Windows", "sparse/0", "not a path below")(binary(image(0, name="C:\\x\\000.png")))
case("name is not UTF-8", "images.bin", "name that is not UTF-8")(binary(image(0, name=b"\xff\xfe.png")))
case("no name", "sparse/0", "''")(binary(image(0, name="")))


@case("no photo of the model", "sparse/0", "none of its 4 photos was found")
def _(folder):
    ColmapModel(CAMERAS, NAMES).write(folder / "sparse/0")


@case("cameras without images", "sparse/0", "cameras.bin, points3D.bin, but not")
def _(folder):
    binary()(folder)
    (folder / "sparse/0/images.bin").unlink()


@case("a folder in place of images.bin", "images.bin", "is a folder, not a file")
def _(folder):
    binary()(folder)
    (folder / "sparse/0/images.bin").unlink()
    (folder / "sparse/0/images.bin").mkdir()


@case("a photo of the model is not a picture", "000.png", "Git-LFS pointer")
def _(folder):
    write_colmap(folder, CAMERAS, NAMES)
    put(folder / "images/000.png", b"version https://git-lfs.github.com/spec/v1\n")


# ------------------------------------------------------------------------------------------------------------------ LLFF
def poses(table=None, data=None, columns=17):
    """Write LLFF poses, as an array or as bytes."""

    def write(folder):
        write_llff(folder, CAMERAS, NAMES, columns)
        if table is not None:
            np.save(folder / "poses_bounds.npy", table)
        if data is not None:
            put(folder / "poses_bounds.npy", data)

    return write


def table_with(row, column, value):
    table = llff_table(CAMERAS)
    table[row, column] = value
    return table


def npy(table=None):
    from io import BytesIO

    stream = BytesIO()
    np.save(stream, llff_table(CAMERAS) if table is None else table)
    return stream.getvalue()


FILE = "poses_bounds.npy"
case("poses: empty", FILE, "is empty")(poses(data=b""))
case("poses: cut header", FILE, "not a complete array")(poses(data=npy()[:50]))
case("poses: cut", FILE, "not a complete array")(poses(data=npy()[:-9]))
case("poses: text", FILE, "not a complete array")(poses(data=b"1 2 3 4\n" * 10))
case("poses: wrong magic", FILE, "not a complete array")(poses(data=b"\x93NUMPX" + npy()[6:]))
case("poses: huge shape", FILE, "not a complete array")(
    poses(data=npy().replace(b"(4, 17), }         ", b"(400000000000, 17),}"))
)
case("poses: pickled", FILE, "not a complete array")(poses(data=npy(np.array([{}, []], object))))
case("poses: an archive", FILE, "not a complete array")(poses(data=b"PK\x05\x06" + b"\0" * 18))
case("poses: words", FILE, "not a complete array")(poses(np.full((4, 17), "word")))
case("poses: 16 columns", FILE, "shape (4, 16)")(poses(np.ones((4, 16))))
case("poses: three axes", FILE, "shape (4, 3, 5)")(poses(np.ones((4, 3, 5))))
case("poses: one number", FILE, "shape ()")(poses(np.float64(3)))
case("poses: no rows", FILE, "shape (0, 17)")(poses(np.ones((0, 17))))
case("poses: nan", FILE, "row 2 has a pose that is not finite")(poses(table_with(2, 3, math.nan)))
case("poses: no rotation", FILE, "row 1 has a pose that is not a rotation")(poses(table_with(1, 0, 2.0)))
case("poses: mirrored", FILE, "row 0 has a pose that is not a rotation")(
    poses(llff_table(CAMERAS) * ([-1] * 4 + [1] * 13))
)
case("poses: zero focal length", FILE, "row 3 has the focal length")(poses(table_with(3, 14, 0)))
case("poses: focal length is nan", FILE, "row 3 has the focal length")(poses(table_with(3, 14, math.nan)))
case("poses: negative height", FILE, "row 0 has a picture of")(poses(table_with(0, 4, -6)))
case("poses: too many", FILE, "3 poses, but images has 4 photos")(poses(llff_table(CAMERAS[:3])))


@case("nex: five numbers", "hwf_cxcy.npy", "holds 5 numbers")
def _(folder):
    write_llff(folder, CAMERAS, NAMES, 14)
    np.save(folder / "hwf_cxcy.npy", np.ones(5))


@case("nex: no second file", FILE, "no hwf_cxcy.npy lies beside it")
def _(folder):
    write_llff(folder, CAMERAS, NAMES, 14)
    (folder / "hwf_cxcy.npy").unlink()


@case("nex: principal point is nan", FILE, "principal point")
def _(folder):
    write_llff(folder, CAMERAS, NAMES, 14)
    np.save(folder / "hwf_cxcy.npy", np.array([6, 8, 5, 5, math.nan, 3]))


@case("poses: no photos", FILE, "no photos")
def _(folder):
    np.save(folder / FILE, llff_table(CAMERAS))


@case("poses: a folder in their place", FILE, "is a folder, not a file")
def _(folder):
    put_photos(folder / "images", NAMES)
    (folder / FILE).mkdir()


# ------------------------------------------------------------------------------------------------------------ transforms
def transforms(change):
    """Write a transforms.json, its content changed by `change(content)` or replaced by what that returns."""

    def write(folder):
        write_transforms(folder, CAMERAS, NAMES)
        content = json.loads((folder / "transforms.json").read_text())
        put_json(folder / "transforms.json", change(content) or content)

    return write


JSON = "transforms.json"
case("json: a number", JSON, "JSON int")(transforms(lambda content: 7))
case("json: frames are text", JSON, "no list of frames")(transforms(lambda content: {**content, "frames": "all"}))
case("json: a frame is a list", JSON, "frame 1 has no file_path")(
    transforms(lambda content: content["frames"].__setitem__(1, []))
)
case("json: matrix of text", JSON, "no 4x4")(
    transforms(lambda content: content["frames"][0].update(transform_matrix=[["a"] * 4] * 4))
)
case("json: size is a list", JSON, "w = [8]")(transforms(lambda content: content.update(w=[8])))
case("json: a size of 10^30", JSON, "declares 1e+30x")(transforms(lambda content: content.update(w=1e30)))
case("json: negative size", JSON, "h = -6")(transforms(lambda content: content.update(h=-6)))
case("json: zero focal length", JSON, "fl_x = 0")(transforms(lambda content: content.update(fl_x=0)))
case("json: unknown lens", JSON, "FISHEYE624 camera")(
    transforms(lambda content: content.update(camera_model="FISHEYE624"))
)


def raw(data):
    def write(folder):
        put_photos(folder / "images", NAMES)
        put(folder / "transforms.json", data)

    return write


case("json: brackets without end", JSON, "cannot be read")(raw(b"[" * 200_000))
case("json: a number without end", JSON, "cannot be read")(raw(b'{"fl_x": ' + b"9" * 10_000 + b"}"))


def cloud(data):
    def write(folder):
        transforms(lambda content: content.update(ply_file_path="cloud.ply"))(folder)
        put(folder / "cloud.ply", data)

    return write


PLY = b"ply\nformat ascii 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty %s z\nend_header\n"
case("points: empty", "cloud.ply", "is empty")(cloud(b""))
case("points: no ply", "cloud.ply", "header cannot be understood")(cloud(b"solid cube\n"))
case("points: cut", "cloud.ply", "cut off")(cloud(PLY % (2, b"float") + b"1 2 3 4 5"))
case("points: 10^15 of them", "cloud.ply", "cut off")(cloud(PLY % (10**15, b"float") + b"1 2 3"))
case("points: -1 of them", "cloud.ply", "header cannot be understood")(cloud(PLY % (-1, b"float")))
case("points: words", "cloud.ply", "not numbers")(cloud(PLY % (1, b"float") + b"1 2 three"))
case("points: nan", "cloud.ply", "not finite")(cloud(PLY % (1, b"float") + b"1 2 nan"))
case("points: unknown type", "cloud.ply", "header cannot be understood")(cloud(PLY % (1, b"half") + b"1 2 3"))


# ------------------------------------------------------------------------------------------------------------- promises
@pytest.mark.parametrize("name", CASES)
def test_damage_gives_one_sentence_that_names_the_file_and_a_remedy(tmp_path, name):
    write, file, words = CASES[name]
    write(tmp_path)
    with pytest.raises(DataError) as caught:
        open_capture(tmp_path)
    sentence = caught.value.sentence
    assert str(tmp_path) in sentence and file in sentence and words in sentence
    assert sentence.endswith(".") and "\n" not in sentence
    assert caught.value.hint.endswith(".")


@pytest.mark.parametrize(
    "name",
    [
        "images.bin cut at 0.5",
        "camera model id 99",
        "poses: nan",
        "poses: cut",
        "json: zero focal length",
        "points: cut",
    ],
)
def test_the_command_line_ends_with_four_and_leaves_nothing(tmp_path, capsys, name):
    pytest.importorskip("torch")
    from karf_engine.cli import main

    write, file, words = CASES[name]
    write(tmp_path / "capture")
    assert main(["geometry", str(tmp_path / "capture"), "--project", str(tmp_path / "project")]) == DataError.exit_code
    errors = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
    assert len(errors) == 1 and file in errors[0] and words in errors[0]
    assert not (tmp_path / "project").exists()
