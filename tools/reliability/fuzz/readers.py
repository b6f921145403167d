"""The registry of readers: what is valid, which file is changed, how, and how the engine reads it.

`readers(project)` is what the tests and the long command both run over. A project may come from a stranger whose
checksums fit its hostile files, so they are renewed after each change.
"""

from __future__ import annotations

import json
import random
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import karf_engine as karf
from karf_engine.capture import open_capture
from karf_engine.capture.capture import capture_to_json
from karf_engine.capture.ply import read_points
from karf_engine.commands.job import open_job
from karf_engine.commands.options import RenderOptions
from karf_engine.commands.recoloring import rays_of
from karf_engine.errors import KarfError
from karf_engine.export.layer_names import read_layer_names
from karf_engine.fields.nerf.files import read_nerf
from karf_engine.heads.files import load_surface
from karf_engine.heads.object_surface import object_pixels
from karf_engine.io.image_size import image_header
from karf_engine.io.images import read_mask, read_photo
from karf_engine.palettes.compositing import read_planes
from karf_engine.palettes.edit_files import read_edit
from karf_engine.palettes.object_colors import read_object_colors
from karf_engine.palettes.palette import read_palettes
from karf_engine.palettes.palette_files import read_edit_file
from karf_engine.palettes.project_edit import edit_of
from karf_engine.project import STAGE_ORDER
from karf_engine.project.contents import capture_of, settings_for
from karf_engine.project.locking import opened
from karf_engine.wire import EventReader, Request

from ...convert_bmild import read_bmild
from ..faults.checksums import renew_checksum
from . import mutate, samples
from .watch import Outcome, read_watched

PLAIN = re.compile(r"(train_|test_)?r_\d+")  # names of views and photos as the samples have them


@dataclass(frozen=True)
class Reader:
    """make: writes valid files into an empty folder. files: which of them are changed. read: is given the changed
    one."""

    name: str
    make: Callable[[Path], None]
    files: tuple[str, ...]
    mutator: mutate.Mutator
    read: Callable[[Path], object]
    is_slow: bool = False  # it renders

    def changed(self, name: str, valid: bytes, folder: Path, chance: random.Random) -> Outcome:
        """Put a changed file in the place of a valid one and read it under watch."""
        path = folder / name
        path.write_bytes(self.mutator(valid, chance))
        renew_checksum(folder, name)
        return read_watched(self.read, path, folder)


class Bed:
    """A folder with one reader's valid files, to be changed one at a time; a reader that writes may write there."""

    def __init__(self, reader: Reader, folder: Path) -> None:
        self.reader, self._folder, self._valid = reader, folder / "files", folder / "valid"
        self._valid.mkdir(parents=True)
        reader.make(self._valid)
        self._restore()

    def _restore(self) -> None:
        shutil.rmtree(self._folder, ignore_errors=True)
        shutil.copytree(self._valid, self._folder)

    def read_valid(self) -> list[Outcome]:
        """What the reader makes of its unchanged files."""
        return [read_watched(self.reader.read, self._folder / name, self._folder) for name in self.reader.files]

    def try_one(self, chance: random.Random) -> Outcome:
        """Change one file, read it, and put everything back."""
        name = chance.choice(self.reader.files)
        outcome = self.reader.changed(name, (self._valid / name).read_bytes(), self._folder, chance)
        self._put_back(name)
        return outcome

    def _put_back(self, changed: str) -> None:
        for name in {changed, "project.json"}:
            if (self._valid / name).exists():
                shutil.copyfile(self._valid / name, self._folder / name)

    @property
    def folder(self) -> Path:
        """Where the changed file lies."""
        return self._folder


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
    read_edit(path, read_palettes(path.with_name("palette.json")))


def swatches(path: Path) -> None:
    read_edit_file(path, samples.SWATCHES)


def state(path: Path) -> None:
    """Open the project as every stage and Blender's panel do."""
    project = opened(path.parent)
    settings_for(project, "render")
    for stage in STAGE_ORDER:
        if project.finished(stage):
            project.require(stage)
    capture_of(project)


def learned(path: Path) -> None:
    """Load all that a render needs."""
    model = karf.load(path.parent, "cpu")
    model.capture.split("test")
    if model.palettes:
        model.learned_colors  # noqa: B018 a property that computes


def surface(path: Path) -> None:
    project = opened(path.parent)
    object_pixels(*load_surface(project.checked(project.surface_file)))


def masked_views(path: Path) -> None:
    """What the recoloring stage learns from in the views that have a mask, which the report names."""
    job = open_job(RenderOptions(project=path.parent, threads=1), lambda kind, /, **values: None, lambda: False)
    project = job.project
    settings = replace(job.settings, recoloring=replace(job.settings.recoloring, supervision="reference"))
    surface, _ = load_surface(project.checked(project.surface_file))
    blocks = read_palettes(project.checked(project.palette_file), "initial")
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
    views = json.loads(path.with_name("capture.json").read_text())["views"]
    strange = [v["name"] for v in views if not (PLAIN.fullmatch(v["name"]) and PLAIN.fullmatch(v["stem"]))]
    _render(path, strange[0] if strange else samples.RENDERED)


def renamed(path: Path) -> None:
    """Give the objects the names of palette.json everywhere, then solve an edit and render."""
    folder = path.parent
    names = [entry["name"] for entry in json.loads(path.read_text())["objects"]]
    for name in ("segmentation.safetensors", "surface.safetensors"):
        file = folder / name
        file.write_bytes(mutate.with_header(file.read_bytes(), lambda header: _with_objects(header, names)))
        renew_checksum(folder, name)
    edits = json.loads((folder / "edit.json").read_text())
    edits["objects"] = dict(zip(names, edits["objects"].values(), strict=True))
    (folder / "edit.json").write_text(json.dumps(edits))
    _render(path, samples.RENDERED)


def _with_objects(header: dict, names: list[str]) -> dict:
    return mutate.with_facts(header, lambda facts: facts | {"objects": names})


def rendered_cameras(path: Path) -> None:
    _render(path, str(path))


def _render(path: Path, views: str) -> None:
    folder = path.parent
    karf.render(folder, folder / "out", views=views, edit=folder / "edit.json", planes=True, threads=1)


def matched(path: Path) -> None:
    """Solve an edit for whatever objects the palettes name."""
    for palette in read_palettes(path):
        edit = edit_of(opened(path.parent))
        edit.becomes(palette.name, "#b5302c", "#3059b8").save(path.parent / "out.json")


# --------------------------------------------------------------------------------------------------------------- registry
def readers(project: Path | None) -> list[Reader]:
    """All readers. project: a learned one (see samples), which is copied; None where only names are asked for."""
    model = "sparse/0/"
    found = [
        Reader("NeRF-synthetic, transforms_train.json", samples.nerf_synthetic, ("transforms_train.json",),
               mutate.mutate_json, capture),
        Reader("transforms.json", samples.transforms, ("transforms.json",), mutate.mutate_json, capture),
        Reader("camera file", samples.camera_file, ("cameras.json",), mutate.mutate_json, new_cameras),
        *(
            Reader(f"COLMAP, {table}{suffix}", samples.colmap(suffix), (f"{model}{table}{suffix}",), mutator, capture)
            for suffix, mutator in ((".bin", mutate.mutate_bytes), (".txt", mutate.mutate_text))
            for table in ("cameras", "images", "points3D")
        ),
        Reader("LLFF, poses_bounds.npy", samples.llff(17), ("poses_bounds.npy",), mutate.mutate_npy, capture),
        Reader("NeX, hwf_cxcy.npy", samples.llff(14), ("hwf_cxcy.npy",), mutate.mutate_npy, capture),
        Reader("PLY", samples.ply, ("text.ply", "binary.ply"), mutate.mutate_text, read_points),
        Reader("PNG", samples.png, ("plain.png", "alpha.png", "palette.png", "deep.png", "deep_gray.png"),
               mutate.mutate_bytes, photo),
        Reader("JPEG", samples.jpeg, ("plain.jpg", "print.jpg"), mutate.mutate_bytes, photo),
        Reader("WebP, BMP, TIFF", samples.other_pictures, ("plain.webp", "plain.bmp", "plain.tif", "deep.tif", "float.tif"),
               mutate.mutate_bytes, photo),
        Reader("EXR", samples.exr, ("zip.exr", "plain.exr"), mutate.mutate_bytes, photo),
        Reader("mask", samples.png, ("plain.png", "alpha.png", "palette.png", "deep_gray.png"), mutate.mutate_bytes,
               read_mask),
        Reader("GIMP palette", samples.swatches, ("swatches.gpl",), mutate.mutate_text, swatches),
        Reader("Adobe swatches", samples.swatches, ("swatches.ase",), mutate.mutate_bytes, swatches),
        Reader("layers", samples.layers, ("view.exr",), mutate.mutate_bytes, read_layer_names),
        Reader("NeRF, torch.save", samples.nerfs, ("zip.tar", "legacy.tar"), mutate.mutate_bytes, read_nerf),
        Reader("NeRF, pickled npy", samples.nerfs, ("model_000001.npy",), mutate.mutate_bytes, read_bmild),
        Reader("request.json", samples.request, ("request.json",), mutate.mutate_json, read_request),
        Reader("events.jsonl", samples.events, ("events.jsonl",), mutate.mutate_bytes, read_events),
    ]  # fmt: skip
    return [*found, *_project_readers(project)]


def _project_readers(project: Path | None) -> list[Reader]:
    copied = samples.project(project)

    def with_cameras(folder: Path) -> None:
        copied(folder)
        samples.camera_file(folder)

    kinds = [
        ("project.json", mutate.mutate_json, state),
        ("capture.json", mutate.mutate_json, learned),
        ("segmentation.json", mutate.mutate_json, masked_views),
        ("palette.json", mutate.mutate_json, learned),
        ("edit.json", mutate.mutate_json, edit),
        ("geometry.safetensors", mutate.mutate_safetensors, learned),
        ("segmentation.safetensors", mutate.mutate_safetensors, learned),
        ("recoloring.safetensors", mutate.mutate_safetensors, learned),
        ("surface.safetensors", mutate.mutate_safetensors, surface),
        ("object_colors.npz", mutate.mutate_npz, object_colors),
        (f"planes/{samples.RENDERED}.npz", mutate.mutate_npz, read_planes),
    ]
    named = [
        ("capture.json", copied, mutate.mutate_names, rendered),
        ("palette.json", copied, mutate.mutate_names, matched),
        ("palette.json and all others", copied, mutate.mutate_names, renamed),
        ("segmentation.safetensors", copied, mutate.name_safetensors, rendered),
        ("edit.json", copied, mutate.mutate_keys, rendered),
        ("cameras.json", with_cameras, mutate.mutate_names, rendered_cameras),
    ]
    found = [Reader(file.partition("/")[0], copied, (file,), mutator, read) for file, mutator, read in kinds]
    for title, make, mutator, read in named:
        file = title.partition(" ")[0]
        found.append(Reader(f"hostile names in {title}", make, (file,), mutator, read, read is not matched))
    return found
