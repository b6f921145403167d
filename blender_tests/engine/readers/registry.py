"""The registry of readers: how to make valid files, mutate them, and read them with the engine."""

import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import karf_engine as karf
from blender_tests.engine.readers import mutations, samples
from blender_tests.engine.readers.mutations import changed_bytes, changed_json, changed_text, changed_zip
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
from karf_engine.project import STAGE_ORDER, Project
from karf_engine.project.contents import read_capture, settings_for
from karf_engine.splats.formats.registry import read_splats
from karf_engine.worker.protocol import EventReader, Request
from tools.convert_bmild import read_bmild


@dataclass(frozen=True)
class Reader:
    """How the engine reads one kind of file."""

    name: str  # the test id
    make: Callable[[Path], None]  # writes valid files into an empty folder
    files: tuple[str, ...]  # the ones to mutate
    mutation: mutations.Mutation
    read: Callable[[Path], object]  # reads a mutated file; may write in its folder
    share: int = 1  # divides the number of mutants, for slow readers


STARTS = 3  # share of readers that start a process


def capture(path: Path) -> None:
    """Open the capture of this file as the geometry stage does; COLMAP's files are in sparse/0."""
    folder = path.parents[2] if path.parent.name == "0" else path.parent
    json.dumps(capture_to_json(open_capture(folder)))


def canonical_capture(path: Path) -> None:
    capture_from_json(read_json(path, "capture"), path)


def photo(path: Path) -> None:
    with suppress(KarfError):  # the picture may be readable without a valid header
        image_header(path)
    read_photo(path)


def state(path: Path) -> None:
    """Open the project as every stage and Blender's panel do."""
    project = project_of(path)
    settings_for(project, "render")
    for stage in STAGE_ORDER:
        if project.finished(stage):
            project.require(stage)
    read_capture(project)


def learned(path: Path) -> None:
    """Load everything that a render needs."""
    model = karf.load(project_of(path).folder, "cpu")
    model.capture.split("test")
    if model.palettes:
        model.learned_colors  # noqa: B018 a property that computes


def surface(path: Path) -> None:
    project = project_of(path)
    object_pixels(*load_surface(project.verified(project.surface_file)))


def masked_views(path: Path) -> None:
    """Load the recoloring stage's training rays of the views with a mask, which the report names."""
    options = RenderOptions(project=project_of(path).folder, threads=1)
    job = open_job(options, lambda kind, /, **values: None, lambda: False)
    settings = replace(job.settings, recoloring=replace(job.settings.recoloring, supervision="reference"))
    surface, _ = load_surface(job.project.verified(job.project.surface_file))
    blocks = read_palettes(job.project.verified(job.project.palette_file), "initial")
    rays_of(replace(job, settings=settings), None, surface, blocks)


def read_events(path: Path) -> None:
    for event in EventReader(path.parent).poll():
        event.is_final, event.get("stage"), event.encode()


def project_of(path: Path) -> Project:
    """The project that a file belongs to."""
    return Project(path.parents[2] if path.parents[1].name == "results" else path.parent)


def readers() -> list[Reader]:
    """All readers except those of a project's files."""
    json_files = [
        ("NeRF-synthetic", samples.nerf_synthetic, "transforms_train.json", capture),
        ("transforms.json", samples.transforms, "transforms.json", capture),
        ("camera file", samples.camera_file, "cameras.json", lambda path: open_capture(path, photos=False)),
        ("cameras of a splat", samples.splat_cameras, "cameras.json", read_splat_cameras),
        ("canonical capture", samples.canonical_capture, "capture.json", canonical_capture),
        ("request.json", samples.request, "request.json", lambda path: Request.read(path.parent)),
    ]
    splats = {
        **dict.fromkeys(("cloud.ply", "text.ply", "cloud.compressed.ply", "cloud.usda"), changed_text),
        **dict.fromkeys(("cloud.splat", "cloud.spz", "streams.spz", "cloud.glb"), changed_bytes),
        **dict.fromkeys(("cloud.usdc", "packed.usdc", "cloud.usdz"), changed_bytes),
        "cloud.sog": changed_zip,
        "cloud.gltf": changed_json,
    }

    def swatches(path: Path) -> None:
        read_edit_file(path, samples.SWATCHES)

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
                   1 if file in in_this_process else STARTS)
            for file, mutation in splats.items()
        ),
        Reader("PNG", samples.pictures, png, changed_bytes, photo),
        Reader("JPEG", samples.pictures, ("plain.jpg", "print.jpg"), changed_bytes, photo),
        Reader("WebP, BMP, TIFF", samples.pictures, others, changed_bytes, photo),
        Reader("EXR", samples.pictures, ("zip.exr", "plain.exr"), changed_bytes, photo),
        Reader("header of a picture", samples.pictures, png, changed_bytes, image_header),
        Reader("mask", samples.pictures, png[:3] + png[4:], changed_bytes, read_mask),
        Reader("GIMP palette", samples.swatches, ("swatches.gpl",), changed_text, swatches),
        Reader("Adobe swatches", samples.swatches, ("swatches.ase",), changed_bytes, swatches),
        Reader("color book, CSV", samples.color_books, ("inks.csv",), changed_text, read_color_book),
        Reader("color book, Adobe", samples.color_books, ("inks.acb",), changed_bytes, read_color_book),
        Reader("layers", samples.layers, ("view.exr",), changed_bytes, read_layer_names),
        Reader("NeRF, torch.save", samples.nerfs, ("zip.tar", "legacy.tar"), changed_bytes, read_nerf),
        Reader("NeRF, pickled npy", samples.nerfs, ("model_000001.npy",), changed_bytes, read_bmild),
        Reader("events.jsonl", samples.events, ("events.jsonl",), changed_bytes, read_events),
    ]  # fmt: skip


def project_readers(project: Path | None) -> list[Reader]:
    """Readers of the files of a copy of a learned project with planes and an edit; None gives names only."""
    make = samples.project(project)

    kinds = [
        ("project.json", changed_json, state),
        ("edit.json", changed_json, lambda path: read_edit(path, read_palettes(project_of(path).palette_file))),
        (f"planes/{samples.RENDERED}.npz", changed_zip, read_planes),
        ("results/geometry-1/capture.json", changed_json, learned),
        ("results/geometry-1/geometry.safetensors", mutations.changed_safetensors, learned),
        ("results/segmentation-1/segmentation.json", changed_json, masked_views),
        ("results/segmentation-1/segmentation.safetensors", mutations.changed_safetensors, learned),
        ("results/segmentation-1/surface.safetensors", mutations.changed_safetensors, surface),
        ("results/recoloring-1/palette.json", changed_json, learned),
        ("results/recoloring-1/recoloring.safetensors", mutations.changed_safetensors, learned),
        ("results/recoloring-1/object_colors.npz", changed_zip, lambda path: read_object_colors(path, "ball")),
        ("results/splats-1/splats.safetensors", mutations.changed_safetensors, learned),
    ]
    return [Reader(Path(file).name, make, (file,), mutation, read) for file, mutation, read in kinds]
