"""A stand-in for the engine: the same command line, events and files in milliseconds, without torch.

Every pixel of a view is half object `pot`, half object `lid`; palettes have black and two colors. A recolored picture is
one flat color: the pot's first swatch as edited. The request option `behave` makes it fail in the ways engines fail.
"""

import json
import os
import shutil
import struct
import sys
import time
import zlib
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))

from karf_engine.capture import open_capture, write_cameras
from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import View, capture_from_json, capture_to_json
from karf_engine.cli import main as engine_main
from karf_engine.edit.compositing import Planes, write_planes
from karf_engine.edit.palette import Palette, read_edit, read_palettes, write_palettes
from karf_engine.files import read_json, write_json
from karf_engine.project import Project
from karf_engine.project.colorways import plan_colorways
from karf_engine.wire import PROTOCOL, EventWriter, Request

LEARNED = {"lid": [[0, 0, 0], [0.2, 0.4, 0.6], [1, 1, 1]], "pot": [[0, 0, 0], [0.8, 0.2, 0.1], [0.9, 0.9, 0.5]]}
SHARES = (0.125, 0.25, 0.125)  # of the three palette entries, each object; exact in float16


def main(job):
    emit = EventWriter(job)
    request = Request.read(job)
    misbehave(request.options.get("behave", ""), emit)
    emit("hello", protocol=PROTOCOL, engine="fake", python="3", torch="none", device="none", pid=os.getpid())
    emit("stage", name=request.stage)
    emit("progress", stage=request.stage, step=1, total=2, rate=10.0, eta_s=0.1, metrics={"loss": 0.5})
    emit("warning", code="fake", sentence="This is no real engine.")
    STAGES[request.stage](Project(request.project), request.options)
    print("threads:", os.environ.get("OMP_NUM_THREADS"))
    emit("done")
    return 0


def misbehave(how, emit):
    if how == "error":
        emit("error", code="data", sentence="photo_7.png is missing.", hint="Find it.")
        sys.exit(4)
    if how == "crash":
        print("something native went wrong", flush=True)
        os.abort()
    if how == "no torch":
        emit("error", code="dependency", sentence="torch is not installed.", hint="Install it.")
        sys.exit(3)
    if how == "silent":
        time.sleep(60)
    if how == "wait for cancel":
        emit("hello", protocol=PROTOCOL)
        line = sys.stdin.readline()
        if line in ("cancel\n", ""):
            emit("cancelled")
            sys.exit(6)
    if how == "deaf":
        emit("hello", protocol=PROTOCOL)
        time.sleep(60)
    if how == "environment":
        Path("environment.json").write_text(json.dumps(dict(os.environ)))


def poses(project, options):
    out = Path(options["out"])
    photos = sorted(Path(options["photos"]).glob("*.png"))
    shutil.copytree(options["photos"], out / "images")
    camera = Camera(24, 16, 30.0, 30.0, 12.0, 8.0, np.eye(4))
    views = [View(f"images/{photo.name}", photo.stem, camera, None, "train") for photo in photos]
    write_cameras(out / "transforms.json", views)


def geometry(project, options):
    project.create(options["capture"])
    write_json(project.capture_file, capture_to_json(open_capture(options["capture"])))
    project.geometry_file.touch()
    project.finish("geometry", "fake", psnr=30.0)


def segmentation(project, options):
    names = sorted(folder.name for folder in Path(options["masks"]).iterdir())
    write_json(project.segmentation_report, {"objects": names})
    project.finish("segmentation", "fake", objects=names)


def palette(project, options):
    palettes = [Palette(name, np.array(colors)) for name, colors in LEARNED.items()]
    write_palettes(project.palette_file, palettes, shared=False)
    arrays = {}
    for name, colors in LEARNED.items():
        arrays[f"{name}/colors"] = np.array(colors[1:], np.float32)
        arrays[f"{name}/counts"] = np.array([10, 5])
        arrays[f"{name}/palette_weights"] = np.eye(3)[1:]
    np.savez(project.object_colors_file, **arrays)
    project.finish("palette", "fake")


def recoloring(project, options):
    project.recoloring_file.touch()
    project.finish("recoloring", "fake")


def render(project, options):
    views = views_of(project, options["views"])
    if options["planes"]:
        for view in views:
            write_view_planes(project, view)
    if options.get("layers"):  # this Python writes no EXR files
        for view in views:
            path = Path(options["out"]) / "layers" / f"{view.name}.exr"
            path.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(os.environ["FAKE_LAYERS"], path)
    if options["edit"]:
        files = options["edit"] if isinstance(options["edit"], list) else [options["edit"]] * len(views)
        for view, file in zip(views, files, strict=True):
            edit = read_edit(Path(file), read_palettes(project.palette_file))
            picture = np.broadcast_to(edit.colors["pot"][1], (view.camera.height, view.camera.width, 3))
            path = Path(options["out"]) / "recolor" / f"{view.name}.png"
            if not (options.get("skip_existing") and path.exists()):
                write_png(path, picture)


def points(project, options):
    shutil.copy(os.environ["FAKE_POINTS"], options["out"])


def colorways(project, options):
    for planned in plan_colorways(project, Path(options["sheet"])):
        for view in views_of(project, options["views"]):
            picture = np.broadcast_to(
                planned.edit.colors["pot"][1].clip(0, 1), (view.camera.height, view.camera.width, 3)
            )
            write_png(Path(options["out"]) / planned.colorway.folder / f"{view.name}.png", picture)


def views_of(project, which):
    if which.endswith(".json"):
        return open_capture(which, photos=False).views
    capture = capture_from_json(read_json(project.capture_file, "capture"), project.capture_file)
    if which in ("all", "train", "test"):
        return capture.split(which)
    return [capture.view(name) for name in which.split(",")]


def write_view_planes(project, view):
    height, width = view.camera.height, view.camera.width
    weights = np.broadcast_to(np.reshape(SHARES, (1, 3, 1, 1)), (2, 3, height, width))
    ramp = np.arange(height * width * 3, dtype=np.uint32).reshape(height, width, 3) % 256
    write_planes(
        project.planes_file(view.name),
        Planes(tuple(LEARNED), weights, weights.sum(axis=1), ramp.astype(np.uint8)),
    )


def write_png(path, picture):
    height, width = picture.shape[:2]
    rows = np.rint(picture * 255).astype(np.uint8).reshape(height, -1)
    raw = b"".join(b"\0" + row.tobytes() for row in rows)
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    path.parent.mkdir(parents=True, exist_ok=True)
    parts = ((b"IHDR", header), (b"IDAT", zlib.compress(raw)), (b"IEND", b""))
    chunks = [struct.pack(">I", len(d)) + n + d + struct.pack(">I", zlib.crc32(n + d)) for n, d in parts]
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunks))


STAGES = {
    stage.__name__: stage for stage in (poses, geometry, segmentation, palette, recoloring, render, points, colorways)
}

if __name__ == "__main__":
    if sys.argv[1] == "doctor":  # the true one: it needs no torch to say that there is none
        sys.exit(engine_main(sys.argv[1:]))
    assert sys.argv[1] == "run", json.dumps(sys.argv)
    sys.exit(main(Path(sys.argv[2])))
