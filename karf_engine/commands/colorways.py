"""Render every colorway of a sheet in every view, and report the colors that they reach.

The colors are predicted and reported before rendering. Writes

    OUT/<colorway>/<view>.png        the recolored view; photos keep their format .png, .tif or .exr; by `names`
    OUT/colorways.csv                each color: target, prediction, measurement, CIEDE2000, and the reason for a miss
    OUT/views.csv                    the same for each view
    OUT/contact_sheet.png            a row for each colorway
    OUT/finished.jsonl               the inputs of each finished picture, which is not made again
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from ..capture import choose_views
from ..capture.capture import View
from ..compute.progress import Emit
from ..errors import BadRequest
from ..export.colorways import (
    ColorProbe,
    Line,
    Reached,
    Row,
    pictures_of,
    write_contact_sheet,
    write_table,
    write_view_table,
)
from ..export.file_names import file_paths, tokens_of
from ..export.finished_frames import FinishedFrames, frame_fingerprint, model_fingerprint, view_fingerprint
from ..palettes.calibration import ReferenceLight
from ..palettes.colorways import PlannedColorway, plan_colorways
from ..palettes.edge_shape import EdgeShape
from ..palettes.palette import read_palettes, rgb_to_hex
from ..palettes.palette_files import read_edit_file
from ..palettes.prediction import Prediction
from ..project import Project
from ..recolor.model import Model
from .calibration import reference_light
from .job import Job, open_job, warn_of_disputes
from .options import ColorwaysOptions

VERSION = 1  # of the pictures; incremented when the same inputs would give others
SHEET_VIEWS, SHEET_ROWS = 6, 100
MAX_WARNINGS = 5


def run(options: ColorwaysOptions, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Report the predicted colors of each colorway, then render all views. Raises DataError for a wrong row of the sheet."""
    project = Project(options.project).snapshot()
    light = reference_light(options, emit)
    edges: Mapping[str, EdgeShape] = {}
    if options.edges is not None:
        project.require("palette")
        edges = read_edit_file(options.edges, read_palettes(project.verified(project.palette_file))).edges
    planned = plan_colorways(project, options.sheet, locked_swatches(options.locked), light, edges)
    _report(planned, light, emit)
    write_table(options.out / "colorways.csv", planned, light=light)
    if not options.predict_only:
        project.require("recoloring")
        job = open_job(options, emit, should_stop, project)
        _Renderer(job, Model(project, job.runtime.device), planned, options, light).run()
        job.artifact("contact sheet", options.out / "contact_sheet.png")
    emit("artifact", kind="colorways", path=str(options.out / "colorways.csv"))


def locked_swatches(swatches: Sequence[str]) -> dict[str, list[int]]:
    """Parse texts `<object>/<number>` to numbers by object. Raises BadRequest for other texts."""
    locked: dict[str, list[int]] = {}
    for swatch in swatches:
        name, slash, number = swatch.rpartition("/")
        if not slash or not number.isdecimal():
            raise BadRequest(f"The locked swatch {swatch!r:.200} is none.", "Write <object>/<number>, as pot/2.")
        locked.setdefault(name, []).append(int(number))
    return locked


def _report(planned: Sequence[PlannedColorway], light: ReferenceLight | None, emit: Emit) -> None:
    """Warn of colors that cannot be reached."""
    emit("stage", name="colorways", text=f"{len(planned)} colorways")
    missed = [(plan.colorway.name, p.under_light(light)) for plan in planned for p in plan.predictions if p.reason]
    for name, prediction in missed[:MAX_WARNINGS]:
        sentence = f"{name}, {prediction.target_color.name}: cannot be reached, because {prediction.reason}."
        emit("warning", code="colorway", sentence=f"{sentence} CIEDE2000 {prediction.ciede2000:.1f}.")
    if len(missed) > MAX_WARNINGS:
        emit("warning", code="colorway", sentence=f"{len(missed) - MAX_WARNINGS} more: see colorways.csv.")


class _Renderer:
    """Renders each view once for all colorways, and skips finished pictures."""

    def __init__(
        self,
        job: Job,
        model: Model,
        planned: Sequence[PlannedColorway],
        options: ColorwaysOptions,
        light: ReferenceLight | None,
    ) -> None:
        self._job, self._model, self._planned, self._out, self._light = job, model, planned, options.out, light
        self._views, self._captured = choose_views(job.capture(), options.views)
        keys = [(plan.colorway, view.name) for plan in planned for view in self._views]
        tokens = [{"look": colorway.folder, **tokens_of(view)} for colorway, view in keys]
        paths = file_paths(options.names, tokens)
        self._paths = {(colorway.name, view): path for (colorway, view), path in zip(keys, paths, strict=True)}
        self._finished = FinishedFrames.read(options.out)
        self._mark, self._size = model_fingerprint(job.project, job.settings), options.size

    def run(self) -> None:
        """Write the unfinished pictures, then the tables and the contact sheet."""
        todo = [(view, marks) for view in self._views if (marks := self._unfinished(view))]
        progress = self._job.progress("colorways", len(self._views) * len(self._planned))
        progress.resume_at(len(self._views) * len(self._planned) - sum(len(marks) for _, marks in todo))
        disputed = {}
        for view, marks in todo:
            progress.step(0)
            pictures = pictures_of(self._model, view, self._size, self._captured)
            disputed[view.name] = pictures.disputed
            probes = ColorProbe(pictures)
            plans = [plan for plan in self._planned if plan.colorway.name in marks]
            for plan, picture in zip(plans, pictures.recolored([plan.edit for plan in plans]), strict=True):
                path = self._out / f"{self._paths[plan.colorway.name, view.name]}{pictures.suffix}"
                pictures.write(path, picture)
                found = {p.target_color.name: probes.measure(picture, p) for p in plan.predictions}
                measured = {name: values for name, values in found.items() if values is not None}
                name = f"{plan.colorway.name}/{view.name}"
                self._finished.record(name, marks[plan.colorway.name], [path], plan.edit, reached=measured)
                progress.step()
        warn_of_disputes(disputed, self._job.emit)
        self._finished = FinishedFrames.read(self._out)
        write_table(self._out / "colorways.csv", self._planned, self._reached, self._light)
        names = [view.name for view in self._views]
        write_view_table(self._out / "views.csv", self._planned, names, self._reached_in, self._light)
        self._write_sheet()

    def _unfinished(self, view: View) -> dict[str, str]:
        """Return the fingerprints of the unfinished pictures of a view, by colorway."""
        own = view_fingerprint(self._mark, view, VERSION, self._size)
        marks = {plan.colorway.name: frame_fingerprint(own, plan.edit) for plan in self._planned}
        return {name: mark for name, mark in marks.items() if not self._finished.has(f"{name}/{view.name}", mark)}

    def _reached(self, plan: PlannedColorway, prediction: Prediction) -> Reached | None:
        """Return the mean measurement of a color over all views, or None where no picture shows it."""
        of_views = [self._reached_in(plan, prediction, view.name) for view in self._views]
        found = [reached for reached in of_views if reached is not None]
        if not found:
            return None
        pixels = [reached.pixels for reached in found]
        color = np.average([reached.color for reached in found], axis=0, weights=pixels)
        return Reached(color, sum(pixels), len(found))

    def _reached_in(self, plan: PlannedColorway, prediction: Prediction, view: str) -> Reached | None:
        """Return the measurement of a color in a view, or None where its picture does not show it."""
        note = self._finished.frames[f"{plan.colorway.name}/{view}"].get("reached", {})
        if prediction.target_color.name not in note:
            return None
        *color, pixels = note[prediction.target_color.name]
        return Reached(np.array(color), int(pixels), 1)

    def _picture(self, plan: PlannedColorway, view: View) -> Path:
        (file,) = self._finished.frames[f"{plan.colorway.name}/{view.name}"]["files"]
        return self._out / file

    def _write_sheet(self) -> None:
        """Write the contact sheet with some evenly spread views."""
        count = min(SHEET_VIEWS, len(self._views))
        chosen = [self._views[number * len(self._views) // count] for number in range(count)]
        is_of_photos = self._captured and self._size != "learned"
        space = chosen[0].space if is_of_photos else None
        rows = [
            Row(_label(plan, self._light), tuple(self._picture(plan, view) for view in chosen), space)
            for plan in self._planned[:SHEET_ROWS]
        ]
        write_contact_sheet(self._out / "contact_sheet.png", [view.name for view in chosen], rows)


def _label(plan: PlannedColorway, light: ReferenceLight | None) -> tuple[Line, ...]:
    """Return a colorway's name, and for each object the target and the predicted color."""
    predictions = [prediction.under_light(light) for prediction in plan.predictions]
    colors = [
        Line(f"{p.target_color.name}  {rgb_to_hex(p.reached)}  {p.ciede2000:.1f}", (p.target, p.reached))
        for p in predictions
    ]
    return Line(plan.colorway.name), *colors
