"""The query `chart`: the light measured by a color chart anywhere in a photo."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from .options import require_option
from .session import Session


def chart(session: Session, options: dict[str, Any]) -> dict[str, Any]:
    """Measure the light by a chart in a photo.

    Args:
        session: Not used.
        options: `photo`, the path of a picture file.

    Returns:
        `light`, the nine numbers of `ReferenceLight.matrix`, row by row; and `left`, `ChartFit.mean_left`.

    Raises:
        KarfError: The photo cannot be read, no chart is found in it, or its colors do not determine the light.
    """
    from ...commands.calibration import fit_chart

    fit = fit_chart(Path(require_option(options, "photo", str)), None)
    return {"light": fit.light.matrix.ravel().tolist(), "left": fit.mean_residual}
