"""A job as a folder that can be taken anywhere: its template, and all that it reads.

The files are those of a job bundle of AWS Deadline Cloud; other programs that work off Open Job Description read the
template alone.

    template.json           the job (see `template`); every path in it leads from this folder
    parameter_values.json   what differs from farm to farm: which Python runs the engine
    asset_references.json   files outside the bundle: none
    engine/                 the engine; the farm's Python needs its packages, not itself
    project/                the learned project, or where it will be
    cameras.json            the cameras that are rendered, where they are none of the capture's
    edit.json, edits/       the edit of all frames, or of each
    photos/                 captured photos that are recolored
    capture/, masks/        what a project will be learned from
    frames/                 what is rendered, once it is
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...capture import open_capture
from ...capture.capture import View
from ...capture.chosen_views import choose_views
from ...errors import BadRequest
from ...export.frame_options import FrameOptions
from ...io.files import copy_file, write_json
from ...io.options import Options
from ...palettes.palette import read_palettes
from ...palettes.palette_files import read_edit_file
from ...project import Project
from ...project.contents import capture_of
from ..options import FarmOptions
from ..output_folder import new_folder
from .packing import (
    capture_files,
    check_copy,
    copy_files,
    listed,
    mask_files,
    pack_engine,
    project_files,
    write_project,
)
from .template import CAMERAS, CAPTURE, ENGINE, PROJECT, Frames, learning_job, render_job


def write_bundle(options: FarmOptions, tell: Callable[[str], None] = lambda line: None) -> Path:
    """Write a bundle that renders frames of a learned project, or with masks one that learns a capture first.

    Args:
        options: What is rendered.
        tell: Called with a line for each folder that files are packed from, before anything is written.

    Returns:
        The bundle's folder, absolute.

    Raises:
        KarfError: The project is not learned or the capture cannot be read, a photo lies elsewhere, a view is unknown,
            an edit is not of this project, or `out` is taken.
    """
    if options.masks is not None:
        return _learning_bundle(options, tell)
    if options.preset is not None:
        raise BadRequest("A learned project has its preset.", "Leave --preset out, or give --masks to learn a capture.")
    return _render_bundle(options, tell)


def _render_bundle(options: FarmOptions, tell: Callable[[str], None]) -> Path:
    learned, edit = Project(options.source), options.edit
    learned.require("geometry")
    learned.contained(options.out)
    chosen, captured = choose_views(capture_of(learned), options.views)
    if isinstance(edit, Path) and edit.is_dir():
        edit = [edit / f"{view.name}.json" for view in chosen]
    _check_edits(learned, edit)
    recolored = chosen if captured else ()
    files = project_files(learned, recolored, options.photos)
    for line in listed(files):
        tell(line)
    with new_folder(options.out.absolute()) as folder:
        copy_files(files, folder)
        write_project(learned, folder / PROJECT, recolored)
        frames = _pack_frames(folder, options, (chosen, captured), edit)
        _finish(folder, render_job(f"KaRF {learned.folder.name}", frames), options.python)
    return options.out.absolute()


def _learning_bundle(options: FarmOptions, tell: Callable[[str], None]) -> Path:
    opened = open_capture(options.source, holdout=options.holdout)
    chosen = choose_views(opened, options.views)
    settings = ["--preset", options.preset or "demo", "--holdout", str(options.holdout)]
    settings += [part for text in options.overrides for part in ("--set", text)]
    files = capture_files(options.source, opened, options.photos) + mask_files(options.masks)
    for line in listed(files):
        tell(line)
    with new_folder(options.out.absolute()) as folder:
        copy_files(files, folder)
        name = check_copy(options.source, opened, folder / CAPTURE)
        (folder / PROJECT).mkdir()
        frames = _pack_frames(folder, replace(options, overrides=()), chosen, options.edit)
        machine = options.narrowed(Options).to_arguments()
        _finish(folder, learning_job(f"KaRF {opened.source.name}", name, settings, machine, frames), options.python)
    return options.out.absolute()


def _check_edits(project: Project, edit: Path | Sequence[Path] | None) -> None:
    """Raise KarfError where an edit is none of the project's: now, and not on the farm."""
    if edit is None:
        return
    project.require("recoloring")
    palettes = read_palettes(project.checked(project.palette_file))
    for path in {edit} if isinstance(edit, Path) else set(edit):
        read_edit_file(path, palettes, "delta")


def _pack_frames(
    folder: Path, options: FarmOptions, chosen: tuple[list[View], bool], edit: Path | Sequence[Path] | None
) -> Frames:
    """Copy cameras and edits. chosen: the views, and whether they are captured ones."""
    found, captured = chosen
    if not captured:
        copy_file(Path(options.views), folder / CAMERAS)
    views = options.views if captured else CAMERAS
    arguments = tuple(options.narrowed(FrameOptions).to_arguments())
    return Frames(views, _pack_edits(folder, edit, found), len(found), options.per_task, arguments)


def _pack_edits(folder: Path, edit: Path | Sequence[Path] | None, views: Sequence[View]) -> str:
    """Copy edits; returns the name of the file, or of the folder that has one for each view, or nothing."""
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
    pack_engine(folder / ENGINE)
    nothing = {"inputs": {"filenames": [], "directories": []}, "outputs": {"directories": []}, "referencedPaths": []}
    write_json(folder / "asset_references.json", {"assetReferences": nothing})
    write_json(folder / "parameter_values.json", {"parameterValues": [{"name": "EnginePython", "value": python}]})
    write_json(folder / "template.json", template)
