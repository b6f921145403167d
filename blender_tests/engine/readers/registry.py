"""The registry of readers: what is valid, which file is changed, how, and how the engine reads it."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import karf_engine as karf
from blender_tests.engine.readers import mutations, samples
from blender_tests.engine.readers.mutations import changed_bytes, changed_json, changed_safetensors, changed_text
from karf_engine.capture import open_capture
from karf_engine.capture.capture import capture_from_json, capture_to_json
from karf_engine.capture.sparse_points import read_points
from karf_engine.capture.splat_cameras import read_splat_cameras
from karf_engine.commands.job import open_job
from karf_engine.commands.options import RenderOptions
from karf_engine.commands.recoloring import rays_of
from karf_engine.errors import KarfError
from karf_engine.export.layer_names import read_layer_names
from karf_engine.fields.nerf.importing import read_nerf
from karf_engine.heads.files import load_surface
from karf_engine.heads.training_rays import object_pixels
from karf_engine.io.files import read_json
from karf_engine.io.image_size import image_header
from karf_engine.io.images import read_mask, read_photo
from karf_engine.palettes.color_books import read_color_book
from karf_engine.palettes.color_histogram import read_object_colors
from karf_engine.palettes.compositing import read_planes
from karf_engine.palettes.palette import read_edit, read_palettes
from karf_engine.palettes.palette_files import read_edit_file
from karf_engine.palettes.project_edit import edit_of
from karf_engine.project import STAGE_ORDER, Project
from karf_engine.project.contents import read_capture, settings_for
from karf_engine.splats.formats.registry import arrays_of, read_splats
from karf_engine.worker.protocol import EventReader, Request
from tools.convert_bmild import read_bmild

RESULTS = {  # stages by output
    "capture.json": "geometry",
    "segmentation.json": "segmentation",
    "palette.json": "recoloring",
    "geometry.safetensors": "geometry",
    "segmentation.safetensors": "segmentation",
    "recoloring.safetensors": "recoloring",
    "splats.safetensors": "splats",
    "surface.safetensors": "segmentation",
    "object_colors.npz": "recoloring",
}
PLAIN = re.compile(r"(train_|test_)?r_\d+")  # names of views and photos as the samples have them


@dataclass(frozen=True)
class Reader:
    """How the engine reads files of one kind."""

    name: str  # as tests are called
    make: Callable[[Path], None]  # writes valid files into an empty folder
    files: tuple[str, ...]  # those that are changed
    mutation: mutations.Mutation
    read: Callable[[Path], object]  # of a changed file, in whose folder it may write
    share: int = 1  # it gets so many times fewer mutants, as it starts a process or renders
    direct: Callable[[Path], object] | None = None  # `read` without a process of its own


STARTS, RENDERS = 3, 10  # values of `share`


# ------------------------------------------------------------------------------------------------------------ how to read
def capture(path: Path) -> None:
    """Open the capture that the file belongs to, as the geometry stage does; COLMAP's lie in sparse/0."""
    folder = path.parents[2] if path.parent.name == "0" else path.parent
    json.dumps(capture_to_json(open_capture(folder)))


def new_cameras(path: Path) -> None:
    json.dumps(capture_to_json(open_capture(path, photos=False)))


def canonical_capture(path: Path) -> None:
    capture_from_json(read_json(path, "capture"), path)


def photo(path: Path) -> None:
    try:
        image_header(path)
    except KarfError:
        pass  # the picture itself may still be of a kind that is known
    read_photo(path)


def edit(path: Path) -> None:
    read_edit(path, read_palettes(project_of(path).palette_file))


def swatches(path: Path) -> None:
    read_edit_file(path, samples.SWATCHES)


def state(path: Path) -> None:
    """Open the project as every stage and Blender's panel do."""
    project = project_of(path)
    settings_for(project, "render")
    for stage in STAGE_ORDER:
        if project.finished(stage):
            project.require(stage)
    read_capture(project)


def learned(path: Path) -> None:
    """Load all that a render needs."""
    model = karf.load(project_of(path).folder, "cpu")
    model.capture.split("test")
    if model.palettes:
        model.learned_colors  # noqa: B018 a property that computes


def surface(path: Path) -> None:
    project = project_of(path)
    object_pixels(*load_surface(project.verified(project.surface_file)))


def masked_views(path: Path) -> None:
    """What the recoloring stage learns from in the views that have a mask, which the report names."""
    options = RenderOptions(project=project_of(path).folder, threads=1)
    job = open_job(options, lambda kind, /, **values: None, lambda: False)
    settings = replace(job.settings, recoloring=replace(job.settings.recoloring, supervision="reference"))
    surface, _ = load_surface(job.project.verified(job.project.surface_file))
    blocks = read_palettes(job.project.verified(job.project.palette_file), "initial")
    rays_of(replace(job, settings=settings), None, surface, blocks)


def object_colors(path: Path) -> None:
    read_object_colors(path, "ball")


def read_request(path: Path) -> None:
    Request.read(path.parent)


def read_events(path: Path) -> None:
    for event in EventReader(path.parent).poll():
        event.is_final, event.get("stage"), event.encode()


def rendered(path: Path) -> None:
    """Render one view of the project, the one with a strange name if there is one, and write all that can be written."""
    views = json.loads(project_of(path).capture_file.read_text())["views"]
    strange = [v["name"] for v in views if not (PLAIN.fullmatch(v["name"]) and PLAIN.fullmatch(v["stem"]))]
    _render(path, strange[0] if strange else samples.RENDERED)


def renamed(path: Path) -> None:
    """Give the objects the names of palette.json everywhere, then solve an edit of each and render."""
    project, folder = project_of(path), project_of(path).folder
    names = [entry["name"] for entry in json.loads(path.read_text())["objects"]]
    for file in (project.segmentation_file, project.surface_file):
        file.write_bytes(mutations.with_facts(file.read_bytes(), lambda facts: facts | {"objects": names}))
        samples.renew_checksum(folder, file)
    edit = edit_of(project)
    for name in names:
        edit = edit.becomes(name, "#b5302c", "#3059b8")
    edit.save(folder / "edit.json")
    _render(path, samples.RENDERED)


def rendered_cameras(path: Path) -> None:
    _render(path, str(path))


def _render(path: Path, views: str) -> None:
    folder = project_of(path).folder
    karf.render(folder, folder / "out", views=views, edit=folder / "edit.json", planes=True, threads=1)


def project_of(path: Path) -> Project:
    """Return the project of one of its files."""
    is_result = path.parent.parent.name == "results"
    return Project(path.parents[2] if is_result else path.parent)


# --------------------------------------------------------------------------------------------------------------- registry
def readers(project: Path | None) -> list[Reader]:
    """All readers. project: a learned one with planes and an edit, which is copied; None where only names are asked for."""
    json_files = [
        ("NeRF-synthetic", samples.nerf_synthetic, "transforms_train.json", capture),
        ("transforms.json", samples.transforms, "transforms.json", capture),
        ("camera file", samples.camera_file, "cameras.json", new_cameras),
        ("cameras of a splat", samples.splat_cameras, "cameras.json", read_splat_cameras),
        ("canonical capture", samples.canonical_capture, "capture.json", canonical_capture),
        ("request.json", samples.request, "request.json", read_request),
    ]
    splats = {
        "cloud.ply": changed_text,
        "text.ply": changed_text,
        "cloud.splat": changed_bytes,
        "cloud.compressed.ply": changed_text,
        "cloud.spz": mutations.changed_gzip,
        "streams.spz": changed_bytes,
        "cloud.sog": mutations.changed_zip,
        "cloud.glb": mutations.changed_glb,
        "cloud.gltf": changed_json,
        "cloud.usda": changed_text,
        "cloud.usdc": changed_bytes,
        "packed.usdc": changed_bytes,
        "cloud.usdz": changed_bytes,
    }
    in_this_process = ("cloud.ply", "text.ply", "cloud.splat")
    png = ("plain.png", "alpha.png", "palette.png", "deep.png", "deep_gray.png")
    others = ("plain.webp", "plain.bmp", "plain.tif", "deep.tif", "float.tif")
    return [
        *(Reader(name, make, (file,), changed_json, read) for name, make, file, read in json_files),
        *(
            Reader(f"{table}{suffix}", samples.colmap(suffix), (f"sparse/0/{table}{suffix}",), mutation, capture)
            for suffix, mutation in ((".bin", changed_bytes), (".txt", changed_text))
            for table in ("cameras", "images", "points3D")
        ),
        Reader("LLFF", samples.llff(17), ("poses_bounds.npy",), mutations.changed_npy, capture),
        Reader("NeX", samples.llff(14), ("hwf_cxcy.npy",), mutations.changed_npy, capture),
        Reader("points in PLY", samples.ply, ("text.ply", "binary.ply"), changed_text, read_points),
        *(
            Reader(f"splats, {file}", samples.splats, (file,), mutation, read_splats,
                   1 if file in in_this_process else STARTS, arrays_of)
            for file, mutation in splats.items()
        ),
        Reader("PNG", samples.png, png, changed_bytes, photo, direct=read_photo),
        Reader("JPEG", samples.jpeg, ("plain.jpg", "print.jpg"), changed_bytes, photo, direct=read_photo),
        Reader("WebP, BMP, TIFF", samples.other_pictures, others, changed_bytes, photo),
        Reader("EXR", samples.exr, ("zip.exr", "plain.exr"), changed_bytes, photo, direct=read_photo),
        Reader("header of a picture", samples.png, png, changed_bytes, image_header),
        Reader("mask", samples.png, png[:3] + png[4:], changed_bytes, read_mask),
        Reader("GIMP palette", samples.swatches, ("swatches.gpl",), changed_text, swatches),
        Reader("Adobe swatches", samples.swatches, ("swatches.ase",), changed_bytes, swatches),
        Reader("color book, CSV", samples.color_books, ("inks.csv",), changed_text, read_color_book),
        Reader("color book, Adobe", samples.color_books, ("inks.acb",), changed_bytes, read_color_book),
        Reader("layers", samples.layers, ("view.exr",), changed_bytes, read_layer_names),
        Reader("NeRF, torch.save", samples.nerfs, ("zip.tar", "legacy.tar"), changed_bytes, read_nerf),
        Reader("NeRF, pickled npy", samples.nerfs, ("model_000001.npy",), changed_bytes, read_bmild),
        Reader("events.jsonl", samples.events, ("events.jsonl",), changed_bytes, read_events),
        *_project_readers(project),
    ]  # fmt: skip


def _project_readers(project: Path | None) -> list[Reader]:
    copied = samples.project(project)

    def with_cameras(folder: Path) -> None:
        copied(folder)
        samples.camera_file(folder)

    kinds = [
        ("project.json", changed_json, state),
        ("capture.json", changed_json, learned),
        ("segmentation.json", changed_json, masked_views),
        ("palette.json", changed_json, learned),
        ("edit.json", changed_json, edit),
        ("geometry.safetensors", changed_safetensors, learned),
        ("segmentation.safetensors", changed_safetensors, learned),
        ("recoloring.safetensors", changed_safetensors, learned),
        ("splats.safetensors", changed_safetensors, learned),
        ("surface.safetensors", changed_safetensors, surface),
        ("object_colors.npz", mutations.changed_zip, object_colors),
        (f"planes/{samples.RENDERED}.npz", mutations.changed_zip, read_planes),
    ]
    named = [
        ("capture.json", copied, rendered),
        ("palette.json", copied, renamed),
        ("cameras.json", with_cameras, rendered_cameras),
    ]
    found = [Reader(file.partition("/")[0], copied, (_place(file),), mutation, read) for file, mutation, read in kinds]
    for file, make, read in named:
        found.append(Reader(f"hostile names in {file}", make, (_place(file),), mutations.hostile_names, read, RENDERS))
    return found


def _place(name: str) -> str:
    """Return where a project that was learned once has a file."""
    stage = RESULTS.get(name)
    return f"results/{stage}-1/{name}" if stage else name
