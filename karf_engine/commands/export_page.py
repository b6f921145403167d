"""Write a web page on which a client turns the scene, and sees its looks live.

Every look must be an edit that adds to the colors, as Gaussians hold no other.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ..compute.progress import Emit
from ..errors import BadRequest, DataError, Message
from ..export.page import Heading, Look, Shown, check_bundle, is_page, make_single, write_page
from ..export.page.orbit import orbit_of
from ..export.page.selection import Visible, measure_visible, most_visible, psnr_of, rows_to_show
from ..io.files import check_file, errors_naming_path, new_folder, refusing_unreadable
from ..io.images import read_photo
from ..palettes.colorways import check_locked, plan_colorways
from ..palettes.palette import Edit
from ..palettes.palette_files import read_edit_file
from ..project import Project
from ..recolor.model import Model
from ..splats.gaussians import subset
from .colorways import locked_swatches
from .export_splat import MIN_PROBABILITY, load_splats
from .job import Job, open_job
from .options import ExportPageOptions

ORIGINAL = "Original"  # name of the look as learned
MOST_GAUSSIANS = 500_000  # that phones show fluently
MOST_LOGO_BYTES = 1 << 20
PICTURES = (".png", ".jpg", ".jpeg", ".webp")


def run(options: ExportPageOptions, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Write the page's folder, in place of an earlier page.

    Raises MissingDependency where the viewer is not built, BadRequest for too many Gaussians, for looks of one name or
    that replace colors, and where the folder has other files, DataError for a wrong look, sheet or logo.
    """
    check_bundle()
    if options.logo is not None:
        check_logo(options.logo)
    project = Project(options.project).snapshot()
    project.require("splats")
    if options.looks or options.sheet or options.locked:
        project.require("recoloring")
    out = options.out.absolute()
    with new_folder(out, is_page) as folder, errors_naming_path(out, folder):
        job = open_job(options, emit, should_stop, project).with_overrides("render", options.overrides)
        model, locked = load_splats(job), locked_swatches(options.locked)
        check_locked(locked, {palette.name: palette for palette in model.palettes})
        looks = _looks(job, model, options, locked)
        cameras = [view.camera for view in job.capture().views]
        progress = job.progress("export-page", len(cameras) + len(looks))
        shown = _shown(job, model, options.reduce, progress.step)
        heading = Heading(options.title or project.folder.name, options.studio, options.logo)
        write_page(folder, model, shown, looks, heading, locked, progress.step)
        if options.single:
            make_single(folder)
        size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    emit("stage", name="export-page", text=f"{len(looks)} looks, {size / 1e6:.1f} MB")
    job.artifact("page", out / "index.html")


def _looks(job: Job, model: Model, options: ExportPageOptions, locked: Mapping[str, Sequence[int]]) -> tuple[Look, ...]:
    """Return the scene as learned, the edits and the colorways of the sheet."""
    looks = [Look(ORIGINAL, Edit({palette.name: palette.colors for palette in model.palettes}))]
    for path in options.looks:
        looks.append(Look(path.stem, read_edit_file(path, model.palettes, job.settings.compositing)))
    if options.sheet is not None:
        planned = plan_colorways(job.project, options.sheet, locked)
        looks += [Look(plan.colorway.name, plan.edit) for plan in planned]
    names = [look.name for look in looks]
    for number, look in enumerate(looks):
        if look.name in names[:number]:
            raise BadRequest(f"Two looks are called {look.name!r:.200}.", "Give one of them another name.")
        if look.edit.compositing != "delta":
            raise BadRequest(
                f"The look {look.name!r:.200} replaces colors, which a page cannot show.", "Make it one that adds."
            )
    return tuple(looks)


def _shown(job: Job, model: Model, most: int | None, step: Callable[[], None]) -> Shown:
    """Choose the Gaussians that are worth showing, and say how many they are."""
    assert model.splatted is not None
    whole, cameras = model.splatted.gaussians, [view.camera for view in job.capture().views]
    is_object = np.any(model.splatted.shares > MIN_PROBABILITY, axis=1)
    of_interest = is_object if is_object.any() else np.arange(len(whole)) < whole.n_foreground
    visible = measure_visible(whole, cameras, of_interest, step)
    rows = _reduced(rows_to_show(whole, visible), visible, most)
    shown = subset(whole, rows)
    text = Message(
        "{shown} of {whole} Gaussians: {share:.1%} are left out, PSNR {psnr:.1f} dB against all.",
        shown=f"{len(rows):,}",
        whole=f"{len(whole):,}",
        share=1 - len(rows) / len(whole),
        psnr=psnr_of(shown, whole, cameras),
    )
    job.emit("stage", name="export-page", text=text)
    return Shown(rows, shown, orbit_of(cameras, whole.table[is_object, :3], visible.objects))


def _reduced(rows: np.ndarray, visible: Visible, most: int | None) -> np.ndarray:
    """Return at most this many rows. Raises BadRequest for too many, if it is None."""
    if most is None and len(rows) > MOST_GAUSSIANS:
        raise BadRequest(
            "{count} Gaussians are too many for a web page: phones show {most}.",
            "Add --reduce {most}, which leaves out the least visible ones and states the loss.",
            count=f"{len(rows):,}",
            most=MOST_GAUSSIANS,
        )
    return rows if most is None else most_visible(rows, visible, most)


def check_logo(path: Path) -> None:
    """Raise DataError unless this is a picture that browsers show, or an SVG drawing that runs no script."""
    check_file(path, MOST_LOGO_BYTES)
    if path.suffix.lower() in PICTURES:
        read_photo(path)
    elif path.suffix.lower() == ".svg":
        _check_drawing(path)
    else:
        raise DataError("{path} is no logo.", "Give a .png, .jpg, .webp or .svg.", path=path)


def _check_drawing(path: Path) -> None:
    with refusing_unreadable(path):
        data = path.read_bytes()
    try:
        elements = list(ElementTree.fromstring(data).iter()) if b"<!ENTITY" not in data else []
    except (ElementTree.ParseError, ValueError):
        elements = []
    names = [str(element.tag).rpartition("}")[2].lower() for element in elements]
    if not names or names[0] != "svg":
        raise DataError("{path} is no SVG drawing.", "Export it again, or give a .png.", path=path)
    attributes = [item for element in elements for item in element.attrib.items()]
    active = {"script", "foreignobject"} & set(names) or any(
        re.match(r"on", name, re.IGNORECASE) or re.match(r"\s*javascript:", value, re.IGNORECASE)
        for name, value in attributes
    )
    if active:
        raise DataError("{path} has scripts.", "Export it as a plain drawing, or give a .png.", path=path)
