"""Colorways: every colorway of a sheet times every view, and what becomes of its colors.

Options: sheet (CSV or JSON, see `edit.color_sheet`), out (folder), views (as the render stage takes them; default all),
predict_only (bool), locked (list of <object>/<number> of swatches that stay as learned). What each color will be is known, and told, before anything is rendered. Writes

    OUT/<colorway>/<view>.png        the recolored view
    OUT/colorways.csv                of each color: wanted, predicted, reached, their CIEDE2000, and why not closer
    OUT/contact_sheet.png            a row for each colorway
    OUT/finished.jsonl               what each picture was made from: one that is there already is not made again
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from ..capture.capture import View
from ..contact_sheet import Line, Row, write_contact_sheet
from ..edit.becomes import near
from ..edit.colorways import Prediction, reached_color
from ..edit.palette import rgb_to_hex
from ..errors import BadRequest
from ..images import write_png
from ..locking import consistent, opened
from ..model import Frame, Model
from ..progress import Emit
from ..project.colorways import PlannedColorway, plan_colorways
from ..wire import Request
from .chosen_views import select_views
from .colorway_table import Reached, write_table
from .finished_frames import FinishedFrames, frame_mark, model_mark, view_mark
from .job import Job, open_job

VERSION = 1
SURE = 0.9  # probability from which a pixel is all the object's
MOST_PROBES = 50_000  # pixels of an object in which a view's colors are measured
SHEET_VIEWS, SHEET_ROWS = 6, 100
MOST_WARNINGS = 5


def run(request: Request, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Tell what each colorway reaches, then write it in all views. Raises BadRequest where sheet or out is missing."""
    project, options = opened(request.project), request.options
    for name in ("sheet", "out"):
        if not options.get(name):
            raise BadRequest(f"The colorways were given no {name}.", "Give a sheet, and a folder to write to.")
    out = Path(options["out"])
    planned = plan_colorways(project, Path(options["sheet"]), _locked(options.get("locked", ())))
    _tell(planned, emit)
    write_table(out / "colorways.csv", planned)
    if not options.get("predict_only"):
        project.require("recoloring")
        with consistent(project):
            job = open_job(request, emit, should_stop)
            work = _Work(job, Model(project, job.runtime.device), planned, out)
        work.run()
        job.artifact("contact sheet", out / "contact_sheet.png")
    emit("artifact", kind="colorways", path=str(out / "colorways.csv"))


def _locked(swatches: Sequence[str]) -> dict[str, list[int]]:
    """Numbers of locked swatches by object, of texts `<object>/<number>`. Raises BadRequest where one is none."""
    locked: dict[str, list[int]] = {}
    for swatch in swatches:
        name, slash, number = swatch.rpartition("/")
        if not slash or not number.isdecimal():
            raise BadRequest(f"The locked swatch {swatch!r:.200} is none.", "Write <object>/<number>, as pot/2.")
        locked.setdefault(name, []).append(int(number))
    return locked


def _tell(planned: Sequence[PlannedColorway], emit: Emit) -> None:
    """Warn of colors that cannot be reached."""
    emit("stage", name="colorways", text=f"{len(planned)} colorways")
    missed = [(plan.colorway.name, p) for plan in planned for p in plan.predictions if p.reason]
    for name, prediction in missed[:MOST_WARNINGS]:
        sentence = f"{name}, {prediction.wish.name}: cannot be reached, because {prediction.reason}."
        emit("warning", code="colorway", sentence=f"{sentence} CIEDE2000 {prediction.ciede2000:.1f}.")
    if len(missed) > MOST_WARNINGS:
        emit("warning", code="colorway", sentence=f"{len(missed) - MOST_WARNINGS} more: see colorways.csv.")


class _Work:
    """Colorways times views: a view is rendered once for all colorways, and a picture that is finished not again."""

    def __init__(self, job: Job, model: Model, planned: Sequence[PlannedColorway], out: Path) -> None:
        self._job, self._model, self._planned, self._out = job, model, planned, out
        self._views, self._captured = select_views(job, job.options.get("views", "all"))
        self._finished = FinishedFrames.read(out)
        self._mark = model_mark(job.project)

    def run(self) -> None:
        """Write what is not finished, then the table and the contact sheet."""
        todo = [(view, marks) for view in self._views if (marks := self._unfinished(view))]
        progress = self._job.progress("colorways", len(self._views) * len(self._planned))
        progress.resume_at(len(self._views) * len(self._planned) - sum(len(marks) for _, marks in todo))
        for view, marks in todo:
            progress.step(0)
            frame = self._model.render_view(view, "photo") if self._captured else self._model.render(view.camera)
            probes = _Probes(self._model.objects, frame)
            for plan in self._planned:
                if (mark := marks.get(plan.colorway.name)) is not None:
                    self._write(view, plan, frame, probes, mark)
                    progress.step()
        write_table(self._out / "colorways.csv", self._planned, self._reached)
        self._write_sheet()

    def _unfinished(self, view: View) -> dict[str, str]:
        """The marks of the pictures of a view that are still to make, by colorway."""
        own = view_mark(self._mark, view, VERSION)
        marks = {plan.colorway.name: frame_mark(own, plan.edit) for plan in self._planned}
        return {name: mark for name, mark in marks.items() if not self._finished.has(self._name(name, view), mark)}

    def _path(self, plan: PlannedColorway, view: View) -> Path:
        return self._out / plan.colorway.folder / f"{view.name}.png"

    def _name(self, colorway: str, view: View) -> str:
        return f"{colorway}/{view.name}"

    def _write(self, view: View, plan: PlannedColorway, frame: Frame, probes: _Probes, mark: str) -> None:
        picture = self._model.composite(frame, plan.edit)
        path = self._path(plan, view)
        write_png(path, picture)
        measured = {p.wish.name: found for p in plan.predictions if (found := probes.measure(picture, p)) is not None}
        self._finished.note(self._name(plan.colorway.name, view), mark, [path], reached=measured)

    def _reached(self, plan: PlannedColorway, prediction: Prediction) -> Reached | None:
        """What was measured of a color in all views together; None where no picture shows it."""
        notes = [self._finished.frames[self._name(plan.colorway.name, view)].get("reached", {}) for view in self._views]
        found = [r[prediction.wish.name] for r in notes if prediction.wish.name in r]
        if not found:
            return None
        values = np.array(found)
        return Reached(np.average(values[:, :3], axis=0, weights=values[:, 3]), int(values[:, 3].sum()), len(found))

    def _write_sheet(self) -> None:
        """The contact sheet, of some views spread over all."""
        count = min(SHEET_VIEWS, len(self._views))
        chosen = [self._views[number * len(self._views) // count] for number in range(count)]
        rows = [
            Row(_label(plan), tuple(self._path(plan, view) for view in chosen)) for plan in self._planned[:SHEET_ROWS]
        ]
        write_contact_sheet(self._out / "contact_sheet.png", [view.name for view in chosen], rows)


class _Probes:
    """The pixels of a frame in which colors are measured: those that are surely an object's, near a source color."""

    def __init__(self, objects: Sequence[str], frame: Frame) -> None:
        self._objects, self._frame = objects, frame
        self._known: dict[tuple, tuple[np.ndarray, np.ndarray]] = {}

    def measure(self, picture: np.ndarray, prediction: Prediction) -> list[float] | None:
        """What the source color has become in a recolored picture, sRGB, and in how many pixels; None where in none."""
        pixels, before = self._of(prediction.wish.name, prediction.source)
        if not len(pixels):
            return None
        color = reached_color(before, picture.reshape(-1, 3)[pixels], prediction.source)
        return [*color.round(5).tolist(), len(pixels)]

    def _of(self, name: str, source: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Running numbers of pixels [n], and their colors before the edit [n, 3]."""
        key = (name, source.tobytes())
        if key not in self._known:
            pixels = np.flatnonzero(self._frame.probabilities[self._objects.index(name)] > SURE)
            pixels = pixels[:: len(pixels) // MOST_PROBES + 1]
            before = self._frame.base.reshape(-1, 3)[pixels]
            alike = near(before, source, or_nearest=False)
            self._known[key] = pixels[alike], before[alike]
        return self._known[key]


def _label(plan: PlannedColorway) -> tuple[Line, ...]:
    """A colorway's name, and of each object the wanted and the predicted color."""
    colors = [
        Line(f"{p.wish.name}  {rgb_to_hex(p.reached)}  {p.ciede2000:.1f}", (p.target, p.reached))
        for p in plan.predictions
    ]
    return Line(plan.colorway.name), *colors
