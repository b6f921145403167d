"""Writers of captures in every format, following each format's description, with tiny photos."""

import json
import math
import struct
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from karf_engine.capture.camera import Camera

DOWN_RIGHT_BACK = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]).T  # of a camera whose axes are right, up, back
RIGHT_DOWN_FORWARD = np.diag([1, -1, -1])
COLMAP_MODELS = (
    "SIMPLE_PINHOLE PINHOLE SIMPLE_RADIAL RADIAL OPENCV OPENCV_FISHEYE FULL_OPENCV FOV SIMPLE_RADIAL_FISHEYE "
    "RADIAL_FISHEYE THIN_PRISM_FISHEYE RAD_TAN_THIN_PRISM_FISHEYE SIMPLE_DIVISION DIVISION SIMPLE_FISHEYE FISHEYE EUCM "
    "EQUIRECTANGULAR"
)
COLMAP_IDS = {name: number for number, name in enumerate(COLMAP_MODELS.split())}


def png_bytes(width: int, height: int) -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    rows = zlib.compress(b"\0" * (height * (width + 1)))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


def jpeg_head(width: int, height: int, orientation: int = 1) -> bytes:
    """The beginning of a JPEG, up to its size."""
    tiff = b"MM\0*" + struct.pack(">IH", 8, 1) + struct.pack(">HHIHH", 0x0112, 3, 1, orientation, 0)
    exif = b"Exif\0\0" + tiff
    frame = struct.pack(">BHHB", 8, height, width, 3) + b"\0" * 9
    head = b"\xff\xd8\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif
    return head + b"\xff\xff\xc2" + struct.pack(">H", len(frame) + 2) + frame  # a fill byte, then progressive SOF


def put(path: Path, data: bytes) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    return path


def put_json(path: Path, content) -> None:
    put(path, json.dumps(content).encode())


def put_photos(folder: Path, names, size=(8, 6)) -> None:
    """Write photos of these names, all of one size or of the cameras' sizes."""
    sizes = [(camera.width, camera.height) for camera in size] if isinstance(size, list) else [size] * len(names)
    for name, (width, height) in zip(names, sizes, strict=True):
        put(folder / name, png_bytes(width, height))


def random_rotation(random) -> np.ndarray:
    rotation, _ = np.linalg.qr(random.normal(size=(3, 3)))
    return rotation * np.sign(np.linalg.det(rotation))


def random_rig(seed: int, count: int = 9, distortion=(), fisheye: bool = False) -> list[Camera]:
    """Cameras at random poses with one lens, with fx != fy and an off-center principal point."""
    random = np.random.default_rng(seed)
    width, height = (int(n) for n in random.integers(4, 60, size=2))
    lens = (*random.uniform(20, 90, 2), *(random.uniform(0.3, 0.7, 2) * (width, height)))
    cameras = []
    for _ in range(count):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = random_rotation(random), random.normal(size=3) * 10
        cameras.append(Camera(width, height, *map(float, lens), pose, tuple(map(float, distortion)), fisheye))
    return cameras


def centered(camera: Camera) -> Camera:
    """The camera as expressed by a format with only one focal length."""
    camera = camera.without_distortion()
    return replace(camera, fy=camera.fx, cx=camera.width / 2, cy=camera.height / 2)


def frames_of(names, cameras, **more) -> list[dict]:
    poses = [camera.camera_to_world.tolist() for camera in cameras]
    return [{"file_path": name, "transform_matrix": pose} | more for name, pose in zip(names, poses, strict=True)]


def write_nerf_synthetic(folder: Path, cameras: list[Camera]) -> None:
    """The layout of NeRF's Blender script; the first two cameras are val and test."""
    angle = 2 * math.atan(cameras[0].width / 2 / cameras[0].fx)
    for split, group in {"train": cameras[2:], "val": cameras[:1], "test": cameras[1:2]}.items():
        names = [f"{split}/r_{number}" for number in range(len(group))]
        frames = frames_of([f"./{name}" for name in names], group, rotation=0.1)
        put_json(folder / f"transforms_{split}.json", {"camera_angle_x": angle, "frames": frames})
        put_photos(folder, [f"{name}.png" for name in names], group)


def write_transforms(folder: Path, cameras: list[Camera], names: list[str]) -> None:
    """The layout of nerfstudio with one lens."""
    first = cameras[0]
    keys = ("k1", "k2", "k3", "k4") if first.fisheye else ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    frames = frames_of([f"images/{name}" for name in names], cameras)
    content = {"camera_model": "OPENCV_FISHEYE" if first.fisheye else "OPENCV", "w": first.width, "h": first.height}
    content |= {"fl_x": first.fx, "fl_y": first.fy, "cx": first.cx, "cy": first.cy, "frames": frames}
    content |= dict(zip(keys, first.distortion, strict=False))
    put_json(folder / "transforms.json", content)
    put_photos(folder / "images", names, cameras)


def llff_table(cameras: list[Camera], columns: int = 17, bounds=(1.5, 40.0)) -> np.ndarray:
    """poses_bounds.npy: [n, 17], or NeX's [n, 14]."""
    rows = []
    for camera in cameras:
        pose = camera.camera_to_world
        block = [pose[:3, :3] @ DOWN_RIGHT_BACK, pose[:3, 3:]]
        if columns == 17:
            block.append([[camera.height], [camera.width], [camera.fx]])
        rows.append([*np.concatenate(block, 1).ravel(), *bounds])
    return np.array(rows)


def write_llff(folder: Path, cameras: list[Camera], names: list[str], columns: int = 17) -> None:
    """The layout of LLFF; with 14 columns that of NeX."""
    put_photos(folder / "images", names, cameras)
    np.save(folder / "poses_bounds.npy", llff_table(cameras, columns))
    if columns == 14:
        first = cameras[0]
        values = [[first.height], [first.width], [first.fx], [first.fy], [first.cx], [first.cy]]
        np.save(folder / "hwf_cxcy.npy", np.array(values))


class ColmapModel:
    """A sparse model to write, after changing entries where damage is wanted.

    cameras: (id, model, width, height, parameters). images: (id, pose [7], camera id, name, features), where features
    are (x, y, point id or -1). points: (id, position, color, error, track), where a track is (image id, feature)s.
    """

    def __init__(self, cameras: list[Camera], names: list[str], seed: int = 0, one_lens: bool = True) -> None:
        random = np.random.default_rng(seed)
        self.cameras = [(7 + i, *self.lens(each)) for i, each in enumerate(cameras[:1] if one_lens else cameras)]
        self.points = [
            (40 - 3 * i, random.normal(size=3), random.integers(0, 256, 3).tolist(), float(random.uniform()), [])
            for i in range(6)
        ]
        self.images = []
        for i, (camera, name) in enumerate(zip(cameras, names, strict=True)):
            features = []
            for point in self.points[i % 3 :: 2]:
                point[4].append((100 - i, len(features)))
                features.append((*random.uniform(0, camera.width, 2), point[0]))
            features.append((*random.uniform(0, camera.width, 2), -1))
            self.images.append((100 - i, self.pose(camera), 7 if one_lens else 7 + i, name, features))

    @staticmethod
    def lens(camera: Camera) -> tuple:
        values = camera.distortion
        kind = "FULL_OPENCV" if len(values) > 4 else "OPENCV" if values else "PINHOLE"
        if camera.fisheye:
            kind, values = "OPENCV_FISHEYE", (*values, 0, 0, 0, 0)[:4]
        if kind == "FULL_OPENCV":
            values = (*values, 0, 0, 0)[:8]
        return kind, camera.width, camera.height, [camera.fx, camera.fy, camera.cx, camera.cy, *values]

    @staticmethod
    def pose(camera: Camera) -> np.ndarray:
        rotation = RIGHT_DOWN_FORWARD @ camera.camera_to_world[:3, :3].T
        x, y, z, w = Rotation.from_matrix(rotation).as_quat()
        return np.array([w, x, y, z, *(-rotation @ camera.camera_to_world[:3, 3])])

    def write(self, folder: Path, suffix: str = ".bin") -> None:
        kind = "binary" if suffix == ".bin" else "text"
        for table in ("cameras", "images", "points3D"):
            put(folder / f"{table}{suffix}", getattr(self, f"{table}_{kind}")())

    def cameras_binary(self) -> bytes:
        data = struct.pack("<Q", len(self.cameras))
        for number, model, width, height, parameters in self.cameras:
            kind = COLMAP_IDS.get(model, model)
            data += struct.pack(f"<IiQQ{len(parameters)}d", number, kind, width, height, *parameters)
        return data

    def images_binary(self) -> bytes:
        data = struct.pack("<Q", len(self.images))
        for number, pose, camera, name, features in self.images:
            name = name if isinstance(name, bytes) else name.encode()
            data += struct.pack("<I7dI", number, *pose, camera) + name + b"\0" + struct.pack("<Q", len(features))
            data += b"".join(struct.pack("<2dq", *feature) for feature in features)
        return data

    def points3D_binary(self) -> bytes:
        data = struct.pack("<Q", len(self.points))
        for number, position, color, error, track in self.points:
            data += struct.pack("<Q3d3BdQ", number, *position, *color, error, len(track))
            data += b"".join(struct.pack("<2I", *element) for element in track)
        return data

    def cameras_text(self) -> bytes:
        return _text("Camera list", ((n, m, w, h, *map(repr, p)) for n, m, w, h, p in self.cameras))

    def images_text(self) -> bytes:
        lines = []
        for number, pose, camera, name, features in self.images:
            lines.append((number, *map(repr, pose.tolist()), camera, name))
            lines.append([f"{float(x)!r} {float(y)!r} {point}" for x, y, point in features])
        return _text("Image list with two lines of data per image", lines)

    def points3D_text(self) -> bytes:
        rows = ((n, *map(repr, map(float, p)), *c, repr(e), *np.ravel(t).astype(int)) for n, p, c, e, t in self.points)
        return _text("3D point list", rows)


def _text(title: str, rows) -> bytes:
    return "".join([f"# {title}\n", *(" ".join(map(str, row)) + "\n" for row in rows)]).encode()


def write_colmap(folder: Path, cameras: list[Camera], names: list[str], suffix: str = ".bin", **options) -> ColmapModel:
    """The layout of COLMAP: photos in `images`, the model in `sparse/0`."""
    put_photos(folder / "images", names, cameras)
    model = ColmapModel(cameras, names, **options)
    model.write(folder / "sparse" / "0", suffix)
    return model
