"""colorways.csv: of each color of each colorway what is wanted, what was predicted, and what was reached."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..io.color import ciede2000, srgb_to_lab
from ..io.files import atomic_write
from ..palettes.colorways.planned import PlannedColorway
from ..palettes.colorways.reached import Prediction
from ..palettes.palette import rgb_to_hex

COLUMNS = ("colorway", "object", "folder", "source", "wanted", "wanted_lab", "predicted", "predicted_ciede2000",
           "reached", "reached_ciede2000", "pixels", "views", "cannot_be_reached_because")  # fmt: skip


@dataclass(frozen=True)
class Reached:
    """A color as measured in written pictures.

    Attributes:
        color: sRGB [3].
        pixels: In how many.
        views: Of how many pictures.
    """

    color: np.ndarray
    pixels: int
    views: int


def write_table(
    path: Path,
    planned: Sequence[PlannedColorway],
    measured: Callable[[PlannedColorway, Prediction], Reached | None] | None = None,
) -> None:
    """Write the table, atomically.

    Args:
        path: The file.
        planned: The colorways.
        measured: What was measured of a color; without it nothing has been rendered yet, and its columns stay empty.
    """
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(COLUMNS)
    for plan in planned:
        for prediction in plan.predictions:
            found = measured(plan, prediction) if measured else None
            table.writerow([plan.colorway.name, *_cells(plan, prediction), *_measured(prediction, found),
                            _reason(prediction, measured is not None and found is None)])  # fmt: skip
    atomic_write(path, lambda temporary: temporary.write_text(text.getvalue(), encoding="utf-8"))


def _cells(plan: PlannedColorway, prediction: Prediction) -> list[str]:
    wanted = rgb_to_hex(prediction.target), _numbers(prediction.target_color.lab)
    predicted = rgb_to_hex(prediction.reached), f"{prediction.ciede2000:.2f}"
    return [prediction.target_color.name, plan.colorway.folder, rgb_to_hex(prediction.source), *wanted, *predicted]


def _measured(prediction: Prediction, found: Reached | None) -> list[str]:
    if found is None:
        return [""] * 4
    difference = float(ciede2000(srgb_to_lab(found.color), prediction.target_color.lab))
    return [rgb_to_hex(found.color), f"{difference:.2f}", str(found.pixels), str(found.views)]


def _reason(prediction: Prediction, is_unseen: bool) -> str:
    if is_unseen:
        return f"none of these views surely shows a pixel of {prediction.target_color.name} in this color"
    return prediction.reason


def _numbers(color: np.ndarray) -> str:
    return " ".join(f"{value:.2f}" for value in color)
