"""The registry of readers: what is valid, which file is changed, how, and how the engine reads it."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import karf_engine as karf
from blender_tests.engine.faults.checksums import renew_checksum
from blender_tests.engine.readers import mutations, samples
from karf_engine.capture import open_capture
from karf_engine.capture.capture import capture_to_json
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
from karf_engine.splats.formats.registry import read_splats
from karf_engine.worker.protocol import EventReader, Request
from tools.convert_bmild import read_bmild

RESULTS = {
    "capture.json": "geometry",
    "segmentation.json": "segmentation",
    "palette.json": "recoloring",
    "geometry.safetensors": "geometry",
    "segmentation.safetensors": "segmentation",
    "recoloring.safetensors": "recoloring",
    "splats.safetensors": "splats",
    "surface.safetensors": "segmentation",
    "object_colors.npz": "recoloring",
}  # stages by output
PLAIN = re.compile(r"(train_|test_)?r_\d+")  # names of views and photos as the samples have them


@dataclass(frozen=True)
class Reader:
    """How the engine reads files of one kind.

    Attributes:
        name: As tests are called.
        make: Writes valid files into an empty folder.
        files: Which of them are changed.
        mutation: How.
        read: Reads the changed one; it may write into its folder.
        is_slow: Whether it renders.
    """

    name: str
    make: Callable[[Path], None]
    files: tuple[str, ...]
    mutation: mutations.Mutation
    read: Callable[[Path], object]
    is_slow: bool = False


# ------------------------------------------------------------------------------------------------------------ how to read
def capture(path: Path) -> None:
    """Open the capture that the file belongs to, as the geometry stage does; COLMAP's lie in sparse/0."""
    folder = path.parents[2] if path.parent.name == "0" else path.parent
    json.dumps(capture_to_json(open_capture(folder)))


def new_cameras(path: Path) -> None:
    json.dumps(capture_to_json(open_capture(path, photos=False)))


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
    job = open_job(
        RenderOptions(project=project_of(path).folder, threads=1), lambda kind, /, **values: None, lambda: False
    )
    project = job.project
    settings = replace(job.settings, recoloring=replace(job.settings.recoloring, supervision="reference"))
    surface, _ = load_surface(project.verified(project.surface_file))
    blocks = read_palettes(project.verified(project.palette_file), "initial")
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
    """Give the objects the names of palette.json everywhere, then solve an edit and render."""
    project, folder = project_of(path), project_of(path).folder
    names = [entry["name"] for entry in json.loads(path.read_text())["objects"]]
    for file in (project.segmentation_file, project.surface_file):
        file.write_bytes(mutations.with_header(file.read_bytes(), lambda header: _with_objects(header, names)))
        renew_checksum(folder, file)
    edits = json.loads((folder / "edit.json").read_text())
    edits["objects"] = dict(zip(names, edits["objects"].values(), strict=True))
    (folder / "edit.json").write_text(json.dumps(edits))
    _render(path, samples.RENDERED)


def _with_objects(header: dict, names: list[str]) -> dict:
    return mutations.with_facts(header, lambda facts: facts | {"objects": names})


def rendered_cameras(path: Path) -> None:
    _render(path, str(path))


def _render(path: Path, views: str) -> None:
    folder = project_of(path).folder
    karf.render(folder, folder / "out", views=views, edit=folder / "edit.json", planes=True, threads=1)


def matched(path: Path) -> None:
    """Solve an edit for whatever objects the palettes name."""
    for palette in read_palettes(path):
        edit = edit_of(project_of(path))
        edit.becomes(palette.name, "#b5302c", "#3059b8").save(edit.project.folder / "out.json")


def project_of(path: Path) -> Project:
    """Return the project of one of its files."""
    is_result = path.parent.parent.name == "results"
    return Project(path.parents[2] if is_result else path.parent)


# --------------------------------------------------------------------------------------------------------------- registry
def readers(project: Path | None) -> list[Reader]:
    """All readers. project: a learned one (see samples), which is copied; None where only names are asked for."""
    model = "sparse/0/"
    found = [
        Reader("NeRF-synthetic, transforms_train.json", samples.nerf_synthetic, ("transforms_train.json",),
               mutations.changed_json, capture),
        Reader("transforms.json", samples.transforms, ("transforms.json",), mutations.changed_json, capture),
        Reader("camera file", samples.camera_file, ("cameras.json",), mutations.changed_json, new_cameras),
        Reader("cameras of a splat", samples.splat_cameras, ("cameras.json",), mutations.changed_json,
               read_splat_cameras),
        *(
            Reader(f"COLMAP, {table}{suffix}", samples.colmap(suffix), (f"{model}{table}{suffix}",), mutation, capture)
            for suffix, mutation in ((".bin", mutations.changed_bytes), (".txt", mutations.changed_text))
            for table in ("cameras", "images", "points3D")
        ),
        Reader("LLFF, poses_bounds.npy", samples.llff(17), ("poses_bounds.npy",), mutations.changed_npy, capture),
        Reader("NeX, hwf_cxcy.npy", samples.llff(14), ("hwf_cxcy.npy",), mutations.changed_npy, capture),
        Reader("PLY", samples.ply, ("text.ply", "binary.ply"), mutations.changed_text, read_points),
        *(
            Reader(f"splats, {name}", samples.splats, (name,), mutation, read_splats)
            for name, mutation in (
                ("cloud.ply", mutations.changed_text),
                ("text.ply", mutations.changed_text),
                ("cloud.compressed.ply", mutations.changed_text),
                ("cloud.spz", mutations.changed_gzip),
                ("streams.spz", mutations.changed_bytes),
                ("cloud.sog", mutations.changed_sog),
                ("cloud.splat", mutations.changed_bytes),
                ("cloud.glb", mutations.changed_glb),
                ("cloud.gltf", mutations.changed_json),
                ("cloud.usda", mutations.changed_text),
                ("cloud.usdc", mutations.changed_bytes),
                ("packed.usdc", mutations.changed_bytes),
                ("cloud.usdz", mutations.changed_bytes),
            )
        ),
        Reader("PNG", samples.png, ("plain.png", "alpha.png", "palette.png", "deep.png", "deep_gray.png"),
               mutations.changed_bytes, photo),
        Reader("JPEG", samples.jpeg, ("plain.jpg", "print.jpg"), mutations.changed_bytes, photo),
        Reader("WebP, BMP, TIFF", samples.other_pictures, ("plain.webp", "plain.bmp", "plain.tif", "deep.tif", "float.tif"),
               mutations.changed_bytes, photo),
        Reader("EXR", samples.exr, ("zip.exr", "plain.exr"), mutations.changed_bytes, photo),
        Reader("mask", samples.png, ("plain.png", "alpha.png", "palette.png", "deep_gray.png"), mutations.changed_bytes,
               read_mask),
        Reader("GIMP palette", samples.swatches, ("swatches.gpl",), mutations.changed_text, swatches),
        Reader("Adobe swatches", samples.swatches, ("swatches.ase",), mutations.changed_bytes, swatches),
        Reader("color book, CSV", samples.color_books, ("inks.csv",), mutations.changed_text, read_color_book),
        Reader("color book, Adobe", samples.color_books, ("inks.acb",), mutations.changed_bytes, read_color_book),
        Reader("layers", samples.layers, ("view.exr",), mutations.changed_bytes, read_layer_names),
        Reader("NeRF, torch.save", samples.nerfs, ("zip.tar", "legacy.tar"), mutations.changed_bytes, read_nerf),
        Reader("NeRF, pickled npy", samples.nerfs, ("model_000001.npy",), mutations.changed_bytes, read_bmild),
        Reader("request.json", samples.request, ("request.json",), mutations.changed_json, read_request),
        Reader("events.jsonl", samples.events, ("events.jsonl",), mutations.changed_bytes, read_events),
    ]  # fmt: skip
    return [*found, *_project_readers(project)]


def _project_readers(project: Path | None) -> list[Reader]:
    copied = samples.project(project)

    def with_cameras(folder: Path) -> None:
        copied(folder)
        samples.camera_file(folder)

    kinds = [
        ("project.json", mutations.changed_json, state),
        ("capture.json", mutations.changed_json, learned),
        ("segmentation.json", mutations.changed_json, masked_views),
        ("palette.json", mutations.changed_json, learned),
        ("edit.json", mutations.changed_json, edit),
        ("geometry.safetensors", mutations.changed_safetensors, learned),
        ("segmentation.safetensors", mutations.changed_safetensors, learned),
        ("recoloring.safetensors", mutations.changed_safetensors, learned),
        ("splats.safetensors", mutations.changed_safetensors, learned),
        ("surface.safetensors", mutations.changed_safetensors, surface),
        ("object_colors.npz", mutations.changed_npz, object_colors),
        (f"planes/{samples.RENDERED}.npz", mutations.changed_npz, read_planes),
    ]
    named = [
        ("capture.json", copied, mutations.hostile_names, rendered),
        ("palette.json", copied, mutations.hostile_names, matched),
        ("palette.json and all others", copied, mutations.hostile_names, renamed),
        ("segmentation.safetensors", copied, mutations.hostile_objects, rendered),
        ("edit.json", copied, mutations.hostile_keys, rendered),
        ("cameras.json", with_cameras, mutations.hostile_names, rendered_cameras),
    ]
    found = [Reader(file.partition("/")[0], copied, (_place(file),), mutation, read) for file, mutation, read in kinds]
    for title, make, mutation, read in named:
        files = (_place(title.partition(" ")[0]),)
        found.append(Reader(f"hostile names in {title}", make, files, mutation, read, read is not matched))
    return found


def _place(name: str) -> str:
    """Return where a project that was learned once has a file."""
    stage = RESULTS.get(name)
    return f"results/{stage}-1/{name}" if stage else name
