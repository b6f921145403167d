"""colorways.csv with the wanted, predicted and reached colors of each colorway; views.csv with those reached in each view.

With a reference light all colors are those under it.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..io.color import ciede2000, srgb_to_lab
from ..io.files import atomic_write
from ..palettes.calibration import ReferenceLight
from ..palettes.colorways import PlannedColorway
from ..palettes.palette import rgb_to_hex
from ..palettes.prediction import Prediction, reason_in_view

COLUMNS = ("colorway", "object", "folder", "source", "wanted", "wanted_lab", "predicted", "predicted_ciede2000",
           "reached", "reached_ciede2000", "pixels", "views", "cannot_be_reached_because")  # fmt: skip

VIEW_COLUMNS = ("colorway", "object", "view", "wanted", "wanted_lab", "reached", "reached_ciede2000", "pixels",
                "cannot_be_reached_because")  # fmt: skip


@dataclass(frozen=True)
class Reached:
    """A color, sRGB [3], as measured in this number of pixels and views."""

    color: np.ndarray
    pixels: int
    views: int


def write_table(
    path: Path,
    planned: Sequence[PlannedColorway],
    measured: Callable[[PlannedColorway, Prediction], Reached | None] | None = None,
    light: ReferenceLight | None = None,
) -> None:
    """Write the table of colorways, atomically.

    Args:
        path: The file.
        planned: The colorways.
        measured: Returns the measurement of a color; None before anything is rendered, to leave its columns empty.
        light: Reference light of the sheet's colors.
    """
    rows = []
    for plan in planned:
        for prediction in plan.predictions:
            found, reason = measured(plan, prediction) if measured else None, prediction.reason
            if measured and found is None:
                reason = f"none of these views surely shows a pixel of {prediction.target_color.name} in this color"
            cells = _cells(plan, prediction, light)
            rows.append([plan.colorway.name, *cells, *_measured(prediction, found, light), reason])
    _write(path, COLUMNS, rows)


def write_view_table(
    path: Path,
    planned: Sequence[PlannedColorway],
    views: Sequence[str],
    measured: Callable[[PlannedColorway, Prediction, str], Reached | None],
    light: ReferenceLight | None = None,
) -> None:
    """Write the reached colors of each view, atomically; see `write_table`.

    measured: returns the measurement of a color in a view; None if no pixel surely shows it.
    """
    rows = [
        [plan.colorway.name, *_view_cells(prediction, view, measured(plan, prediction, view), light)]
        for plan in planned
        for prediction in plan.predictions
        for view in views
    ]
    _write(path, VIEW_COLUMNS, rows)


def _write(path: Path, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([columns, *rows])
    atomic_write(path, lambda temporary: temporary.write_text(text.getvalue(), encoding="utf-8"))


def _view_cells(prediction: Prediction, view: str, found: Reached | None, light: ReferenceLight | None) -> list[str]:
    name, wanted = prediction.target_color.name, _wanted(prediction.under_light(light))
    if found is None:
        return [name, view, *wanted, "", "", "0", f"this view surely shows no pixel of {name} in this color"]
    color, difference, pixels, _ = _measured(prediction, found, light)
    return [name, view, *wanted, color, difference, pixels, reason_in_view(prediction, found.color)]


def _cells(plan: PlannedColorway, prediction: Prediction, light: ReferenceLight | None) -> list[str]:
    lit = prediction.under_light(light)
    return [
        prediction.target_color.name,
        plan.colorway.folder,
        rgb_to_hex(prediction.source),
        *_wanted(lit),
        rgb_to_hex(lit.reached),
        f"{lit.ciede2000:.2f}",
    ]


def _wanted(prediction: Prediction) -> tuple[str, str]:
    return rgb_to_hex(prediction.target), " ".join(f"{value:.2f}" for value in prediction.target_color.lab)


def _measured(prediction: Prediction, found: Reached | None, light: ReferenceLight | None) -> list[str]:
    if found is None:
        return [""] * 4
    lit = replace(prediction, reached=found.color).under_light(light)
    difference = float(ciede2000(srgb_to_lab(lit.reached), lit.target_color.lab))
    return [rgb_to_hex(lit.reached), f"{difference:.2f}", str(found.pixels), str(found.views)]
