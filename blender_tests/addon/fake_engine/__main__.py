"""A stand-in for the engine: the same command line, events and files within milliseconds, without torch.

Every pixel is half `pot`, half `lid`; palettes have black and two colors. A recolored picture is one flat color, the pot's
first swatch as edited. The request option `behave` makes it fail in the ways engines fail.
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

from karf_engine.capture import choose_views, open_capture, write_cameras
from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import Capture, CapturedSplats, View, capture_from_json, capture_to_json
from karf_engine.capture.transforms import camera_from_json, write_capture
from karf_engine.cli import main as engine_main
from karf_engine.commands.options import options_of_job
from karf_engine.export.file_names import named, tokens_of
from karf_engine.export.finished_frames import FinishedFrames, frame_fingerprint
from karf_engine.io.files import read_json, write_json
from karf_engine.palettes.color_histogram import ColorHistogram, write_object_colors
from karf_engine.palettes.colorways import plan_colorways
from karf_engine.palettes.compositing import Planes, write_planes
from karf_engine.palettes.palette import Palette, read_edit, read_palettes, write_palettes
from karf_engine.project import Project
from karf_engine.project.state import result_fingerprint
from karf_engine.worker.protocol import PROTOCOL, WARM, EventWriter, Request, decode_line

LEARNED = {"lid": [[0, 0, 0], [0.2, 0.4, 0.6], [1, 1, 1]], "pot": [[0, 0, 0], [0.8, 0.2, 0.1], [0.9, 0.9, 0.5]]}
SHARES = (0.125, 0.25, 0.125)  # weights of each object's three palette colors; exact in float16


def main(job, is_waiting):
    """Run a job and, if asked to wait, those that follow on standard input."""
    code = run(job)
    while is_waiting and (line := sys.stdin.readline()) not in ("cancel\n", ""):
        code = run(Path(decode_line(line)))
    return code


def run(job):
    emit, request = EventWriter(job), Request.read(job)
    misbehave(request.options.pop("behave", ""), emit)
    emit("hello", protocol=PROTOCOL, engine="fake", python="3", torch="none", device="none", pid=os.getpid())
    if request.stage == WARM:
        return answer_queries(job, emit)
    options_of_job(request.stage, request.project, request.options)  # raises the engine's errors
    emit("stage", name=request.stage)
    emit("progress", stage=request.stage, step=1, total=2, rate=10.0, eta_s=0.1, metrics={"loss": 0.5})
    emit("warning", code="fake", sentence="This is not a real engine.")
    STAGES[request.stage](Project(request.project), request.options)
    print("threads:", os.environ.get("OMP_NUM_THREADS"))
    emit("done")
    return 0


def misbehave(how, emit):
    if how == "error":
        emit("error", code="data", sentence="photo_7.png is missing.", hint="Find it.")
        sys.exit(4)
    if how == "no torch":
        emit("error", code="dependency", sentence="torch is not installed.", hint="Install it.")
        sys.exit(3)
    if how == "crash":
        print("something native went wrong", flush=True)
        os.abort()
    if how in ("wait for cancel", "deaf"):
        emit("hello", protocol=PROTOCOL)
    if how in ("silent", "deaf"):
        time.sleep(60)
    if how == "wait for cancel" and sys.stdin.readline() in ("cancel\n", ""):
        emit("cancelled")
        sys.exit(6)
    if how == "environment":
        Path("environment.json").write_text(json.dumps(dict(os.environ)))


def answer_queries(job, emit):
    for line in sys.stdin:
        query = decode_line(line)
        behave = query.options.get("behave", "")
        if behave == "crash":
            os.abort()
        elif behave == "idle":  # exits just when a query comes
            break
        elif behave == "refuse":
            emit("refused", id=query.number, code="data", sentence="photo_7.png is missing.", hint="Find it.")
        elif behave == "busy":
            time.sleep(60)
        elif behave == "drop":
            emit("dropped", id=query.number)
        else:
            emit("answer", id=query.number, **QUERIES[query.kind](job, query.options))
    emit("done")
    return 0


# --- queries: functions of a job's folder and the options -----------------------------------------------------------
def echo(job, options):
    """The options, and the number of this process."""
    return {"options": options, "pid": os.getpid()}


def propose(job, options):
    """The box and 3 pixels around clicks on the object, minus those around other clicks."""
    view = open_capture(options["capture"]).view(options["view"])
    rows, columns = np.mgrid[0 : view.camera.height, 0 : view.camera.width] + 0.5
    mask, prompts = np.zeros(rows.shape, bool), options["prompts"]
    if prompts["box"]:
        x0, y0, x1, y1 = prompts["box"]
        mask |= (columns > x0) & (columns < x1) & (rows > y0) & (rows < y1)
    for x, y, is_object in prompts["points"]:
        mask[np.hypot(columns - x, rows - y) < 3] = is_object
    return {"mask": write_mask(new_file(job, "png"), mask)}


def correct(job, options):
    """The pot fills the left half of any view."""
    (view,) = views_of(Project(options["project"]), options["view"])
    return {"masks": {"pot": write_mask(new_file(job, "png"), left_half(view))}}


def photo(job, options):
    """A gray photo."""
    camera, path = camera_from_json(options["camera"], "the query"), new_file(job, "png")
    write_png(path, np.full((camera.height, camera.width, 3), 0.5))
    return {"photo": str(path)}


def masks(job, options):
    """The lid left, the pot right of the middle of any view."""
    (view,) = views_of(Project(options["project"]), options["view"])
    return {"masks": write_masks(job / "answers", view)}


def preview(job, options):
    """Planes of one gray: the camera's distance from the origin, times 20 of 255."""
    camera = camera_from_json(options["camera"], "the query").reduced(options["long_side"])
    path, planes = new_file(job, "npz"), planes_of(camera)
    planes.base[:] = min(255, round(20 * np.linalg.norm(camera.position)))
    write_planes(path, planes)
    return {"planes": str(path), "size": [camera.width, camera.height]}


def show(job, options):
    """The pot's first swatch, darker by row; the scene fills the upper half, as far away as the origin is."""
    camera = camera_from_json(options["camera"], "the query")
    height, width = camera.height, camera.width
    color = options["edit"]["objects"]["pot"]["colors"][1] if options["edit"] else (1, 1, 1)
    upper = np.arange(height)[:, None] < height // 2
    arrays = {
        "color": np.linspace(1, 0.5, height)[:, None, None] * np.broadcast_to(color, (height, width, 3)),
        "alpha": np.broadcast_to(upper, (height, width)),
        "depth": np.where(upper, np.linalg.norm(camera.position), 0) * np.ones((1, width)),
        "cryptomatte": np.broadcast_to([0.5, 1.0, 0.0, 0.0], (1, height, width, 4)),
        "weights": np.broadcast_to(np.reshape(SHARES, (1, 3, 1, 1)), (2, 3, height, width)),
        "seen": np.full((height, width), 0.75 if options["unseen"] == "faded" else 0.25),
    }
    metadata = {"cryptomatte/1234567/name": options.get("cryptomatte", "")}
    passes = {name: arrays[name] for name in options.get("passes", ["color"])}
    return write_arrays(job, passes) | {"size": [width, height], "metadata": metadata, "seconds": 0.01}


def harmonics(job, options):
    """One splat per point: the pot's first swatch, and higher harmonics that count the points."""
    count = options["points"]["count"]
    colors = np.empty((count, 4, 3))
    colors[:, 0] = options["edit"]["objects"]["pot"]["colors"][1]
    colors[:, 1:] = np.arange(count)[:, None, None] + [[[0.1], [0.2], [0.3]]]
    return write_arrays(job, {"harmonics": colors.reshape(count, -1)}) | {"n_solid": count, "seconds": 0.01}


def inspect(job, options):
    """Three photos are too few, and the second is blurred."""
    few = {"key": "{count} photos are too few here: take more {where}.", "values": {"count": "3", "where": "above"}}
    blurred = {"key": "Less sharp than the photos beside them: {names}.", "values": {"names": "photo_1"}}
    picture = write_mask(new_file(job, "png"), np.zeros((4, 6), bool))
    found = {"advice": [few, blurred], "is_poor": options.get("masks") is None, "blurred": ["photo_1"]}
    return found | {"picture": picture}


def chart(job, options):
    """The light on the photo's chart is half as bright."""
    assert Path(options["photo"]).is_file()
    return {"light": [0.5, 0, 0, 0, 0.5, 0, 0, 0, 0.5], "left": 0.25}


# --- stages: functions of a project and the options -----------------------------------------------------------------
def poses(project, options):
    out = Path(options["out"])
    shutil.copytree(options["photos"], out / "images")
    camera = Camera(24, 16, 30.0, 30.0, 12.0, 8.0, np.eye(4))
    photos = sorted(Path(options["photos"]).glob("*.png"))
    views = [View(f"images/{photo.name}", photo.stem, camera, None, "train") for photo in photos]
    write_cameras(out / "transforms.json", views)


def import_splat(project, options):
    """Two views of the splats, gray, and a link to them."""
    out, views = Path(options["out"]), []
    for number in range(2):
        pose = np.diag([1.0, -1, -1, 1])  # the capture's y points down
        pose[0, 3] = number
        path = out / "images" / f"view_00{number}.png"
        write_png(path, np.full((16, 24, 3), 0.5))
        views.append(View(path.stem, path.stem, Camera(24, 16, 30.0, 30.0, 12.0, 8.0, pose), path, "train"))
    splats = CapturedSplats(Path(shutil.copy(options["splat"], out)))
    write_capture(out / "transforms.json", Capture(out, "transforms", tuple(views), splats=splats), out)


def export_splat(project, options):
    """Writes the options in place of splats."""
    Path(options["out"]).write_text(json.dumps(options))


def export_page(project, options):
    """Writes the options in place of a page."""
    write_json(Path(options["out"]) / "index.html", options)


def splats(project, options):
    project.splats_file.touch()
    project.finish("splats", "fake", gaussians=3, quality=options.get("quality", "draft"))


def erase(project, options):
    """A splat for each box."""
    boxes = options.get("boxes", [])
    write_json(project.path("boxes.json"), boxes)
    project.finish("splats", "fake", gaussians=3, erased=len(boxes))


def geometry(project, options):
    project.create(options["capture"])
    write_json(project.capture_file, capture_to_json(open_capture(options["capture"])))
    project.geometry_file.touch()
    project.finish("geometry", "fake", psnr=30.0, without=options.get("without", []))


def segmentation(project, options):
    names = sorted(folder.name for folder in Path(options["masks"]).iterdir())
    centers = {name: [0.0, 0.0, float(number)] for number, name in enumerate(names)}
    write_json(project.segmentation_report, {"objects": names, "centers": centers})
    project.uncertainty_file.touch()
    project.finish("segmentation", "fake", objects=names)


def palette(project, options):
    found = {name: np.array(colors) for name, colors in LEARNED.items()}
    write_palettes(project.palette_file, [Palette(*each) for each in found.items()], shared=False)
    counts, weights = np.array([10, 5]), np.eye(3)[1:]
    seen = {name: ColorHistogram(colors[1:].astype(float), counts, weights) for name, colors in found.items()}
    write_object_colors(project.object_colors_file, seen)
    project.finish("palette", "fake")


def recoloring(project, options):
    project.recoloring_file.touch()
    project.finish("recoloring", "fake")


def render(project, options):
    views, out, edit = views_of(project, options["views"]), Path(options["out"] or ""), options["edit"]
    edits = edit if isinstance(edit, list) else [edit] * len(views)
    for view, file in zip(views, edits, strict=True):
        if options["planes"]:
            fingerprint = result_fingerprint(project.state(), "recoloring")
            write_planes(project.planes_file(view.name), planes_of(view.camera), fingerprint)
        if options.get("layers"):  # this Python writes no EXR files
            path = out / "layers" / f"{view.name}.exr"
            path.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(os.environ["FAKE_LAYERS"], path)
        elif options["out"] and not edit:  # the learned scene in flat blue, and masks
            write_flat(out / "render" / f"{view.name}.png", view, (0.0, 0.0, 1.0))
            for folder in ("masks", "unsure") if options.get("unsure") else ("masks",):
                write_masks(out / folder, view)
        name = named(options.get("names", "recolor/{view}"), tokens_of(view.name))
        path, finished = out / f"{name}.png", FinishedFrames.read(out)
        made_by = read_edit(Path(file), read_palettes(project.palette_file)) if edit else None
        mark = frame_fingerprint("", made_by)
        if edit and not (options.get("skip_existing") and finished.has(name, mark)):
            write_flat(path, view, made_by.colors["pot"][1])
            finished.record(name, mark, [path], made_by)


def colorways(project, options):
    for planned in plan_colorways(project, Path(options["sheet"])):
        for view in views_of(project, options["views"]):
            name = named(options["names"], {"look": planned.colorway.folder, **tokens_of(view.name)})
            path = Path(options["out"]) / f"{name}.png"
            write_flat(path, view, planned.edit.colors["pot"][1].clip(0, 1))
            FinishedFrames(path.parents[name.count("/")]).record(name, "fake", [path], planned.edit)


def points(project, options):
    shutil.copy(os.environ["FAKE_POINTS"], options["out"])


# --- views and files -------------------------------------------------------------------------------------------------
def views_of(project, which):
    return choose_views(capture_from_json(read_json(project.capture_file, "capture"), project.capture_file), which)[0]


def planes_of(camera):
    height, width = camera.height, camera.width
    weights = np.broadcast_to(np.reshape(SHARES, (1, 3, 1, 1)), (2, 3, height, width))
    ramp = np.arange(height * width * 3, dtype=np.uint32).reshape(height, width, 3) % 256
    return Planes(tuple(LEARNED), weights, weights.sum(axis=1), ramp.astype(np.uint8))


def left_half(view):
    return np.indices((view.camera.height, view.camera.width))[1] < view.camera.width // 2


def new_file(job, suffix):
    path = job / "answers" / f"{time.monotonic_ns()}.{suffix}"
    path.parent.mkdir(exist_ok=True)
    return path


def write_masks(out, view):
    """Write masks with the lid left and the pot right of the middle; returns the files by object."""
    mask = left_half(view)
    return {name: write_mask(out / name / f"{view.name}.png", own) for name, own in (("lid", mask), ("pot", ~mask))}


def write_mask(path, mask):
    write_png(path, mask[..., None].repeat(3, axis=-1))
    return str(path)


def write_flat(path, view, color):
    write_png(path, np.broadcast_to(color, (view.camera.height, view.camera.width, 3)))


def write_arrays(job, arrays):
    path, placed = new_file(job, "pixels"), {}
    with path.open("wb") as stream:
        for name, array in arrays.items():
            placed[name] = {"shape": list(array.shape), "dtype": "float32", "offset": stream.tell()}
            stream.write(array.astype(np.float32).tobytes())
    return {"pixels": str(path), "arrays": placed}


def write_png(path, picture):
    height, width = picture.shape[:2]
    rows = np.insert(np.rint(picture * 255).astype(np.uint8).reshape(height, -1), 0, 0, axis=1)
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    path.parent.mkdir(parents=True, exist_ok=True)
    parts = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes())), (b"IEND", b""))
    chunks = [struct.pack(">I", len(d)) + n + d + struct.pack(">I", zlib.crc32(n + d)) for n, d in parts]
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunks))


STAGES = {"poses": poses, "geometry": geometry, "segmentation": segmentation, "palette": palette, "splats": splats}
STAGES |= {"erase": erase, "recoloring": recoloring, "render": render, "points": points, "colorways": colorways}
STAGES |= {"import-splat": import_splat, "export-splat": export_splat, "export-page": export_page}
QUERIES = {
    each.__name__: each for each in (echo, preview, propose, photo, correct, masks, show, harmonics, inspect, chart)
}

if __name__ == "__main__":
    if sys.argv[1] == "doctor":  # the real one, which needs no torch to say that there is none
        sys.exit(engine_main(sys.argv[1:]))
    assert sys.argv[1] == "run", json.dumps(sys.argv)
    sys.exit(main(Path(sys.argv[2]), "--wait" in sys.argv))
