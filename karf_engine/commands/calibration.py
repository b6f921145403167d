"""The reference light of a command's options: by a gray card's color, or by a color chart in a photo."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..compute.progress import Emit
from ..errors import BadRequest
from ..io.images import read_photo
from ..palettes.color_chart import MOST_CONDITION, ChartFit, fit_photo
from ..palettes.project_edit import as_color
from ..palettes.reference_light import ReferenceLight
from ..recolor.chart_detection import find_corners
from .options.editing import CalibrationOptions


def light_of(options: CalibrationOptions, emit: Emit) -> ReferenceLight | None:
    """The light under which target colors are meant; None where they are meant as photos show them.

    Raises:
        BadRequest: The card or the chart tells nothing.
        DataError: The photo of the chart cannot be read.
    """
    if options.light is not None:
        matrix = np.reshape(options.light, (3, 3))
        if not np.linalg.cond(matrix) < MOST_CONDITION:
            raise BadRequest("The light's matrix cannot be undone.", "Give that of a color chart or a gray card.")
        return ReferenceLight(matrix)
    if options.card is not None:
        return ReferenceLight.of_card(as_color(options.card))
    if options.chart is None:
        return None
    fit = read_chart(options.chart, options.corners)
    emit("stage", name="chart", text=str(fit))
    return fit.light


def read_chart(path: Path, corners: tuple[float, ...] | None) -> ChartFit:
    """What a chart in a photo says; corners: u and v of all four, None to look for it."""
    photo = read_photo(path)[..., :3]
    found = find_corners(photo) if corners is None else np.reshape(corners, (4, 2))
    if found is None:
        raise BadRequest(
            "No color chart was found in {path}.",
            "Click its four corners, or give them in pixels: --corners u,v,u,v,u,v,u,v.",
            path=path,
        )
    return fit_photo(photo, found)
