"""Write a job bundle: a self-contained folder with a job template and all its input files.

The layout is that of AWS Deadline Cloud's job bundles; other implementations of Open Job Description read only the
template.

    template.json           the job (see `template`); its paths are relative to this folder
    parameter_values.json   the Python that runs the engine, which differs from farm to farm
    asset_references.json   files outside the bundle: none
    engine/                 the engine; the farm's Python needs only its dependencies
    project/                the learned project, or the place for it
    cameras.json            the cameras to render, if they are not the capture's
    edit.json, edits/       the edit of all frames, or one for each
    photos/                 captured photos to recolor
    capture/, masks/        the input of learning
    frames/                 the output
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...capture import choose_views, open_capture
from ...capture.capture import View
from ...compute.progress import Emit
from ...errors import BadRequest
from ...export.frame_options import FrameOptions
from ...io.files import copy_file, new_folder, write_json
from ...io.options import Options
from ...palettes.palette import read_palettes
from ...palettes.palette_files import read_edit_file
from ...project import Project
from ...project.contents import read_capture
from ..options import FarmOptions
from .packing import PackedFile, capture_files, check_copy, mask_files, project_files, summary_of, write_project
from .template import CAMERAS, CAPTURE, ENGINE, PROJECT, Frames, learning_job, render_job

ENGINE_FOLDER = Path(__file__).resolve().parents[2]


def run(options: FarmOptions, emit: Emit, should_stop: Callable[[], bool]) -> Path:
    """Write a bundle that renders frames of a learned project, or with masks one that learns a capture first.

    Emits a line for each folder that files are packed from before writing. Returns the bundle's absolute folder.
    """
    del should_stop  # copies files only
    if options.masks is not None:
        _write_learning_bundle(options, options.masks, emit)
    elif options.preset is not None:
        raise BadRequest("A learned project has its preset.", "Leave --preset out, or give --masks to learn a capture.")
    else:
        _write_render_bundle(options, emit)
    emit("artifact", kind="bundle", path=str(options.out.absolute()))
    return options.out.absolute()


def _write_render_bundle(options: FarmOptions, emit: Emit) -> None:
    learned, edit = Project(options.source), options.edit
    learned.require("geometry")
    learned.check_inside(options.out)
    chosen, captured = choose_views(read_capture(learned), options.views)
    if isinstance(edit, Path) and edit.is_dir():
        edit = [edit / f"{view.name}.json" for view in chosen]
    _check_edits(learned, edit)
    recolored = chosen if captured else ()
    files = project_files(learned, recolored, options.photos)
    _announce(files, emit)
    with new_folder(options.out.absolute()) as folder:
        for file in files:
            copy_file(file.source, folder / file.target)
        write_project(learned, folder / PROJECT, recolored)
        frames = _pack_frames(folder, options, (chosen, captured), edit)
        _finish(folder, render_job(f"KaRF {learned.folder.name}", frames), options.python)


def _write_learning_bundle(options: FarmOptions, masks: Path, emit: Emit) -> None:
    opened = open_capture(options.source, holdout=options.holdout)
    chosen = choose_views(opened, options.views)
    settings = ["--preset", options.preset or "demo", "--holdout", str(options.holdout)]
    settings += [part for text in options.overrides for part in ("--set", text)]
    files = capture_files(options.source, opened, options.photos) + mask_files(masks)
    _announce(files, emit)
    with new_folder(options.out.absolute()) as folder:
        for file in files:
            copy_file(file.source, folder / file.target)
        name = check_copy(options.source, opened, folder / CAPTURE)
        (folder / PROJECT).mkdir()
        frames = _pack_frames(folder, replace(options, overrides=()), chosen, options.edit)
        machine = options.subset(Options).to_arguments()
        _finish(folder, learning_job(f"KaRF {opened.source.name}", name, settings, machine, frames), options.python)


def _announce(files: Sequence[PackedFile], emit: Emit) -> None:
    for line in summary_of(files):
        emit("stage", name="farm", text=line)


def _check_edits(project: Project, edit: Path | Sequence[Path] | None) -> None:
    if edit is None:
        return
    project.require("recoloring")
    palettes = read_palettes(project.verified(project.palette_file))
    for path in {edit} if isinstance(edit, Path) else set(edit):
        read_edit_file(path, palettes, "delta")


def _pack_frames(
    folder: Path, options: FarmOptions, chosen: tuple[list[View], bool], edit: Path | Sequence[Path] | None
) -> Frames:
    """Copy cameras and edits. chosen: the views, and whether they are the capture's."""
    found, captured = chosen
    if not captured:
        copy_file(Path(options.views), folder / CAMERAS)
    views = options.views if captured else CAMERAS
    arguments = tuple(options.subset(FrameOptions).to_arguments())
    return Frames(views, _pack_edits(folder, edit, found), len(found), options.per_task, arguments)


def _pack_edits(folder: Path, edit: Path | Sequence[Path] | None, views: Sequence[View]) -> str:
    """Copy edits and return the name of their file or folder in the bundle, or an empty text."""
    if edit is None:
        return ""
    if isinstance(edit, Path):
        name = f"edit{edit.suffix}"
        copy_file(edit, folder / name)
        return name
    if len(edit) != len(views):
        raise BadRequest(f"There are {len(edit)} edits for {len(views)} views.", "Give one for each view.")
    (folder / "edits").mkdir()
    for path, view in zip(edit, views, strict=True):
        copy_file(path, folder / "edits" / f"{view.name}.json")
    return "edits"


def _finish(folder: Path, template: dict[str, Any], python: str) -> None:
    engine = folder / ENGINE / ENGINE_FOLDER.name
    shutil.copytree(ENGINE_FOLDER, engine, ignore=shutil.ignore_patterns("__pycache__"))
    nothing = {"inputs": {"filenames": [], "directories": []}, "outputs": {"directories": []}, "referencedPaths": []}
    write_json(folder / "asset_references.json", {"assetReferences": nothing})
    write_json(folder / "parameter_values.json", {"parameterValues": [{"name": "EnginePython", "value": python}]})
    write_json(folder / "template.json", template)
