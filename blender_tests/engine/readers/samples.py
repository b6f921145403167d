"""Small valid files of every kind that the engine reads."""

import atexit
import hashlib
import json
import shutil
import struct
import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import pytest
import torch
from PIL import Image

from blender_tests.engine.reference import capture_files, checkpoints
from blender_tests.engine.reference.still_life import cameras
from blender_tests.engine.splats.formats.files import ENDS, unit_cloud, write_sog, write_splat, write_text
from karf_engine.capture.capture import Capture, View, capture_to_json
from karf_engine.export.layers import write_layers
from karf_engine.fields.nerf.field import NerfNetwork, NerfShape
from karf_engine.palettes.palette import Edit, Palette
from karf_engine.palettes.palette_files import write_edit_file
from karf_engine.recolor.frames import Layers
from karf_engine.splats.formats.packed import to_package
from karf_engine.splats.formats.registry import read_splats, write_splats
from karf_engine.splats.formats.splat_file import SplatFile
from karf_engine.splats.kernels.arrays import LOGIT
from karf_engine.worker.protocol import Event, Request

RENDERED = "test_r_0"  # the view with planes in the learned project
NAMES = [f"photo_{number}.png" for number in range(4)]


def nerf_synthetic(folder: Path) -> None:
    capture_files.write_nerf_synthetic(folder, cameras(5, 8))


def transforms(folder: Path) -> None:
    """A nerfstudio capture with a lens and sparse points."""
    capture_files.write_transforms(folder, cameras(4, 8), NAMES)
    content = json.loads((folder / "transforms.json").read_text())
    more = {"ply_file_path": "points.ply", "test_filenames": [f"images/{NAMES[0]}"], "k1": 0.01}
    capture_files.put_json(folder / "transforms.json", content | more)
    (folder / "points.ply").write_text(PLY_TEXT)


def splat_cameras(folder: Path) -> None:
    """The camera file beside a splat."""
    entry = {"width": 8, "height": 8, "fx": 9.0, "fy": 9.0, "position": [1.0, 2, 3], "rotation": np.eye(3).tolist()}
    (folder / "cameras.json").write_text(json.dumps([entry, entry]))


def camera_file(folder: Path) -> None:
    """Cameras to render from."""
    frames = capture_files.frames_of(["frame_0", "frame_1"], cameras(2, 8))
    content = {"w": 8, "h": 6, "fl_x": 9.0, "fl_y": 9.0, "cx": 4, "cy": 3, "k1": 0.1, "frames": frames}
    capture_files.put_json(folder / "cameras.json", content)


def canonical_capture(folder: Path) -> None:
    """The engine's own capture.json of a photo with a lens."""
    camera = replace(cameras(1, 8)[0], distortion=(0.1, 0.0, 0.0, 0.0))
    view = View("a", "a", camera, None, "train", (1.0, 5.0), gains=(1.25, 1.0, 0.75))
    (folder / "capture.json").write_text(json.dumps(capture_to_json(Capture(folder, "test", (view,)))))


def colmap(suffix: str) -> Callable[[Path], None]:
    """A sparse model with files of this suffix."""
    return lambda folder: capture_files.write_colmap(folder, cameras(4, 8), NAMES, suffix) and None


def llff(columns: int) -> Callable[[Path], None]:
    """poses_bounds.npy, or with 14 columns NeX's two files."""
    return lambda folder: capture_files.write_llff(folder, cameras(4, 8), NAMES, columns)


PLY_TEXT = (
    "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n"
    "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n1 2 3 4 5 6\n1 2 3 4 5 6\n"
)


def ply(folder: Path) -> None:
    """PLY_TEXT, and a binary file of three points followed by a face."""
    (folder / "text.ply").write_text(PLY_TEXT)
    axes = "".join(f"property double {axis}\n" for axis in "xyz")
    head = f"ply\nformat binary_little_endian 1.0\ncomment x\nelement vertex 3\n{axes}"
    head += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    (folder / "binary.ply").write_bytes(head.encode() + np.arange(9.0).tobytes() + b"\x03" + bytes(12))


def _pixels(channels: int = 3) -> np.ndarray:
    return np.random.default_rng(0).integers(0, 256, (6, 8, channels), np.uint8)


def pictures(folder: Path) -> None:
    """Pictures rotated by Exif, with alpha, with a palette, in CMYK, of 16 bits and of floats."""
    exif, picture, words = Image.Exif(), Image.fromarray(_pixels()), _pixels().astype(np.uint16) * 257
    exif[0x0112] = 6
    for suffix in (".png", ".jpg"):
        picture.save(folder / f"plain{suffix}", exif=exif)
    for suffix in (".webp", ".bmp", ".tif"):
        picture.save(folder / f"plain{suffix}")
    Image.fromarray(_pixels(4)).save(folder / "alpha.png")
    picture.convert("P").save(folder / "palette.png")
    picture.convert("CMYK").save(folder / "print.jpg")
    cv2.imwrite(str(folder / "deep.png"), words)
    cv2.imwrite(str(folder / "deep_gray.png"), words[..., 0])
    cv2.imwrite(str(folder / "deep.tif"), words)
    cv2.imwrite(str(folder / "float.tif"), _pixels().astype(np.float32) / 255)
    for name, compression, channels in (("zip", OpenEXR.ZIP_COMPRESSION, 3), ("plain", OpenEXR.NO_COMPRESSION, 4)):
        header = {"compression": compression, "type": OpenEXR.scanlineimage}
        pixels = (_pixels(channels) / 255).astype(np.float32 if channels == 3 else np.float16)
        OpenEXR.File(header, {"RGBA"[:channels]: pixels}).write(str(folder / f"{name}.exr"))


SWATCHES = tuple(Palette(name, np.array([[0, 0, 0], [0.75, 0.25, 0.5]], np.float32)) for name in ("pot", "my mug"))


def color_books(folder: Path) -> None:
    """A color book of each kind that `swatches` does not cover."""
    (folder / "inks.csv").write_text("name,hex,lab\nRed,#ff0000,\nSky,,48 -14 -32\n")
    texts = [struct.pack(">I", len(each)) + each.encode("utf-16-be") for each in ("Ink", "INK ", "", "", "1 C", "2 C")]
    head = b"8BCB" + struct.pack(">HH", 1, 3000) + b"".join(texts[:4]) + struct.pack(">4H", 2, 7, 3, 7)
    (folder / "inks.acb").write_bytes(head + b"".join(name + b"      " + bytes([138, 209, 198]) for name in texts[4:]))


def swatches(folder: Path) -> None:
    edit = Edit({palette.name: palette.colors for palette in SWATCHES})
    for suffix in (".gpl", ".ase"):
        write_edit_file(folder / f"swatches{suffix}", edit)


def layers(folder: Path) -> None:
    weights = np.full((2, 2, 6, 8), 0.25, np.float16)
    write_layers(folder / "view.exr", Layers(SWATCHES, _pixels(), weights.sum(1), weights))


def nerfs(folder: Path) -> None:
    """A tiny network as each program stores it."""
    shape = NerfShape(depth=3, width=8, skips=(1,), view_width=4, position_frequencies=2, direction_frequencies=1,
                      linear_first=False, rectified_features=False)  # fmt: skip
    state = NerfNetwork(shape).state_dict()
    both = {"network_fn_state_dict": state, "network_fine_state_dict": state, "loss": np.float64(0.5)}
    torch.save(both, folder / "zip.tar")
    torch.save({"network_fn_state_dict": state}, folder / "legacy.tar", _use_new_zipfile_serialization=False)
    checkpoints.write_arrays(folder / "model_000001.npy", checkpoints.bmild_arrays(state))


def splats(folder: Path) -> None:
    """A few Gaussians in every format."""
    shutil.copytree(_splats(), folder, dirs_exist_ok=True)


@cache
def _splats() -> Path:
    """Write each splat file once and read it, so that packages have compiled their code."""
    gsply, usd_utils = pytest.importorskip("gsply"), pytest.importorskip("pxr.UsdUtils")
    folder, table = Path(tempfile.mkdtemp()), unit_cloud(12, 1)
    atexit.register(shutil.rmtree, folder)
    for end in ENDS:
        write_splats(folder / f"cloud{end}", SplatFile(table, True, {"label": np.arange(12, dtype=np.int32)}))
    write_sog(folder / "cloud.sog", table)
    write_splat(folder / "cloud.splat", table)
    write_text(folder / "text.ply", table)
    gsply.write_spz(folder / "streams.spz", to_package(table), version=4)
    alike = unit_cloud(20, 0)
    alike[:, LOGIT] = 16  # usd-core packs sixteen or more equal numbers
    write_splats(folder / "packed.usdc", SplatFile(alike))
    usd_utils.CreateNewUsdzPackage(str(folder / "cloud.usdc"), str(folder / "cloud.usdz"))
    for path in folder.iterdir():
        if path.suffix != ".bin":
            read_splats(path)
    return folder


def request(folder: Path) -> None:
    Request("match", folder / "project", {"masks": "/masks", "threads": 1}).write(folder)


def events(folder: Path) -> None:
    progress = {"stage": "geometry", "step": 1, "total": 2, "rate": 1.0, "eta_s": 1.0, "metrics": {}}
    sent = {"hello": {"protocol": 1, "pid": 3}, "progress": progress, "done": {"summary": {}}}
    lines = [Event(kind, number, 1.0 + number, values).encode() for number, (kind, values) in enumerate(sent.items())]
    (folder / "events.jsonl").write_text("\n".join(lines) + "\n")


def project(learned: Path | None) -> Callable[[Path], None]:
    """A copy of a learned project without project.json's checksum, which would reject every change."""

    def copy(folder: Path) -> None:
        shutil.copytree(learned, folder, dirs_exist_ok=True)
        state = folder / "project.json"
        content = json.loads(state.read_text())
        del content["checksum"]
        state.write_text(json.dumps(content))

    return copy


def renew_checksum(project: Path, path: Path) -> None:
    """Update the checksum of a stage's changed output in project.json, as an attacker would."""
    state_file = project / "project.json"
    try:
        state = json.loads(state_file.read_text())
        noted = [entry["files"] for entry in state["stages"].values() if path.parent.name == entry.get("folder")]
    except (OSError, ValueError, KeyError, AttributeError, TypeError):  # project.json itself was changed or is missing
        return
    for files in noted:
        files[path.name] = hashlib.sha256(path.read_bytes()).hexdigest()
    if noted:
        state.pop("checksum", None)  # without a checksum project.json is trusted
        state_file.write_text(json.dumps(state, indent=1) + "\n")
