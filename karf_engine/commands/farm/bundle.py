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

import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ...capture import open_capture
from ...capture.capture import View
from ...capture.chosen_views import choose_views
from ...errors import BadRequest
from ...io.files import write_json
from ...palettes.palette import read_palettes
from ...palettes.palette_files import read_edit_file
from ...project import Project
from ...project.contents import capture_of
from .options import MACHINE, PER_TASK, PICTURES, PYTHON
from .packing import pack_capture, pack_engine, pack_masks, pack_project
from .template import CAMERAS, CAPTURE, ENGINE, MASKS, PROJECT, Frames, learning_job, render_job

PathLike = Path | str


def render_bundle(
    project: PathLike,
    out: PathLike,
    *,
    views: str = "all",
    edit: PathLike | Sequence[PathLike] | None = None,
    per_task: int = PER_TASK,
    python: str = PYTHON,
    **pictures: Any,
) -> Path:
    """Write a bundle that renders frames of a learned project, a task for every few of them.

    Args:
        project: The project's folder.
        out: The bundle's folder, new or empty.
        views: A split, names with commas, or the path of a CAMERAS.json, as for `api.render`.
        edit: File of an edit; or one for each view, in their order, or a folder with `<view>.json` for each.
        per_task: How many frames a task renders.
        python: The Python of the farm's machines that has the engine's packages.
        **pictures: What else `api.render` takes of `PICTURES`.

    Returns:
        The bundle's folder, absolute.

    Raises:
        KarfError: The project is not learned, a view is unknown, an edit is none of this project's, or `out` is taken.
    """
    learned = Project(project)
    learned.require("geometry")
    chosen, captured = choose_views(capture_of(learned), views)
    if isinstance(edit, PathLike) and Path(edit).is_dir():
        edit = [Path(edit, f"{view.name}.json") for view in chosen]
    _check_edits(learned, edit)
    with _new_folder(Path(out)) as folder:
        pack_project(learned, folder / PROJECT, chosen if captured else ())
        frames = _pack_frames(folder, views, (chosen, captured), edit, per_task, _arguments(pictures))
        _finish(folder, render_job(f"KaRF {learned.folder.name}", frames), python)
    return Path(out).absolute()


def learning_bundle(
    capture: PathLike,
    masks: PathLike,
    out: PathLike,
    *,
    preset: str = "demo",
    overrides: Sequence[str] = (),
    holdout: int = 0,
    views: str = "all",
    edit: PathLike | None = None,
    per_task: int = PER_TASK,
    python: str = PYTHON,
    **pictures: Any,
) -> Path:
    """Write a bundle that learns a capture, a step for every stage, and then renders frames of it.

    Args:
        capture: A capture whose photos lie below its folder.
        masks: A folder of rough masks.
        out: The bundle's folder, new or empty.
        preset: As for `api.learn`.
        overrides: Single settings of all stages, each as `stage.field=value`.
        holdout: As for `api.learn`.
        views: As for `render_bundle`.
        edit: File of an edit; that of a palette fits whatever palettes will be learned.
        per_task: As for `render_bundle`.
        python: As for `render_bundle`.
        **pictures: As for `render_bundle`; `threads` and `device` count for learning too.

    Returns:
        The bundle's folder, absolute.

    Raises:
        KarfError: The capture or the masks cannot be read, a photo lies elsewhere, or `out` is taken.
    """
    opened = open_capture(capture, holdout=holdout)
    chosen = choose_views(opened, views)
    settings = ["--preset", preset, "--holdout", str(holdout), *_arguments({"overrides": overrides})]
    machine = _arguments({name: pictures.get(name) for name in MACHINE})
    with _new_folder(Path(out)) as folder:
        name = pack_capture(Path(capture), opened, folder / CAPTURE)
        pack_masks(Path(masks), folder / MASKS)
        (folder / PROJECT).mkdir()
        frames = _pack_frames(folder, views, chosen, edit, per_task, _arguments(pictures))
        _finish(folder, learning_job(f"KaRF {opened.source.name}", name, settings, machine, frames), python)
    return Path(out).absolute()


def _check_edits(project: Project, edit: PathLike | Sequence[PathLike] | None) -> None:
    """Raise KarfError where an edit is none of the project's: now, and not on the farm."""
    if edit is None:
        return
    project.require("recoloring")
    palettes = read_palettes(project.checked(project.palette_file))
    for path in {Path(edit)} if isinstance(edit, PathLike) else set(map(Path, edit)):
        read_edit_file(path, palettes, "delta")


def _pack_frames(
    folder: Path,
    views: str,
    chosen: tuple[list[View], bool],
    edit: PathLike | Sequence[PathLike] | None,
    per_task: int,
    arguments: Sequence[str],
) -> Frames:
    """Copy cameras and edits. chosen: the views, and whether they are captured ones."""
    if per_task < 1:
        raise BadRequest(f"{per_task} frames a task are none.", "Give a number from 1.")
    found, captured = chosen
    if not captured:
        shutil.copyfile(views, folder / CAMERAS)
    return Frames(
        views if captured else CAMERAS, _pack_edits(folder, edit, found), len(found), per_task, tuple(arguments)
    )


def _pack_edits(folder: Path, edit: PathLike | Sequence[PathLike] | None, views: Sequence[View]) -> str:
    """Copy edits; returns the name of the file, or of the folder that has one for each view, or nothing."""
    if edit is None:
        return ""
    if isinstance(edit, PathLike):
        name = f"edit{Path(edit).suffix}"
        shutil.copyfile(edit, folder / name)
        return name
    if len(edit) != len(views):
        raise BadRequest(f"There are {len(edit)} edits for {len(views)} views.", "Give one for each view.")
    (folder / "edits").mkdir()
    for path, view in zip(edit, views, strict=True):
        shutil.copyfile(path, folder / "edits" / f"{view.name}.json")
    return "edits"


def _arguments(options: Mapping[str, Any]) -> list[str]:
    """Options of `api.render` as arguments of the command line.

    Examples:
        >>> _arguments({"alpha": True, "depth": False, "size": 800, "overrides": ["render.edges=field"]})
        ['--alpha', '--size', '800', '--set', 'render.edges=field']
    """
    found = []
    for name, value in options.items():
        if name not in PICTURES:
            raise BadRequest(f"A bundle knows no option {name!r}.", f"Use one of: {', '.join(PICTURES)}.")
        if name == "overrides":
            found += [part for text in value for part in ("--set", text)]
        elif value is True:
            found.append(f"--{name}")
        elif value not in (None, False):
            found += [f"--{name}", str(value)]
    return found


def _finish(folder: Path, template: dict[str, Any], python: str) -> None:
    pack_engine(folder / ENGINE)
    nothing = {"inputs": {"filenames": [], "directories": []}, "outputs": {"directories": []}, "referencedPaths": []}
    write_json(folder / "asset_references.json", {"assetReferences": nothing})
    write_json(folder / "parameter_values.json", {"parameterValues": [{"name": "EnginePython", "value": python}]})
    write_json(folder / "template.json", template)


@contextmanager
def _new_folder(out: Path) -> Iterator[Path]:
    """A folder that becomes `out` once the body is done. Raises BadRequest where that is taken."""
    out = out.absolute()
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise BadRequest(f"{out} is not empty.", "Choose a new folder for the bundle.")
    out.parent.mkdir(parents=True, exist_ok=True)
    unfinished = out.with_name(f".{out.name}.unfinished")
    shutil.rmtree(unfinished, ignore_errors=True)
    unfinished.mkdir()
    try:
        yield unfinished
        if out.exists():
            out.rmdir()
        unfinished.replace(out)
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
