"""Make the reference light of a command's options: from a matrix, a gray card's color, or a color chart in a photo."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from ..compute.progress import Emit
from ..errors import BadRequest
from ..io.color import to_bytes
from ..io.images import read_photo
from ..palettes.calibration import MAX_CONDITION, ChartFit, ReferenceLight, fit_photo
from ..palettes.project_edit import as_color
from .options import CalibrationOptions


def reference_light(options: CalibrationOptions, emit: Emit) -> ReferenceLight | None:
    """Return the light of target colors; None where they are colors of the photos.

    Raises BadRequest if card or chart do not determine the light, DataError for an unreadable photo.
    """
    if options.light is not None:
        matrix = np.reshape(options.light, (3, 3))
        if not np.linalg.cond(matrix) < MAX_CONDITION:
            raise BadRequest("The light's matrix cannot be undone.", "Give that of a color chart or a gray card.")
        return ReferenceLight(matrix)
    if options.card is not None:
        return ReferenceLight.of_card(as_color(options.card))
    if options.chart is None:
        return None
    fit = fit_chart(options.chart, options.corners)
    emit("stage", name="chart", text=str(fit))
    return fit.light


def fit_chart(path: Path, corners: tuple[float, ...] | None) -> ChartFit:
    """Measure a chart in a photo; corners: u and v of all four, None to detect them."""
    photo = read_photo(path)[..., :3]
    found = find_corners(photo) if corners is None else np.reshape(corners, (4, 2))
    if found is None:
        raise BadRequest(
            "No color chart was found in {path}.",
            "Click its four corners, or give them in pixels: --corners u,v,u,v,u,v,u,v.",
            path=path,
        )
    return fit_photo(photo, found)


def find_corners(photo: np.ndarray) -> np.ndarray | None:
    """Find the corners of a chart's block of patches (OpenCV's box is a little wider) in a photo, or None."""
    detector = cv2.mcc.CCheckerDetector_create()  # pyright: ignore[reportAttributeAccessIssue]
    detector.setColorChartType(cv2.mcc.MCC24)
    found = detector.process(np.ascontiguousarray(to_bytes(photo[..., ::-1])), 1)
    return detector.getBestColorChecker().getBox().astype(np.float64) if found else None
